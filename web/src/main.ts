// One loop behind a server or in the page, or all stations of a network in the page.

import type { Recorded } from "./local.ts";
import { single } from "./single.ts";
import { wheels, type RecordedNetwork } from "./wheels.ts";

const { hapt } = window as { hapt?: Recorded | RecordedNetwork };
if (hapt && "network" in hapt) wheels(hapt);
else single(hapt);
