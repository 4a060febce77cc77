//! `hapt flash`: a world onto a board.

use std::io::{Write, stdout};
use std::process::ExitCode;

use hapt_host::DeviceAddress;
use hapt_host::device::BoardPort;
use hapt_model::World;

use crate::args::{FlashArgs, device};
use crate::failure::Failure;
use crate::messages::say;
use crate::world::{Loaded, load};

pub fn run(args: &FlashArgs) -> Result<ExitCode, Failure> {
    let mut loaded = load(&args.world)?;
    let address = device(&args.device)?;
    let DeviceAddress::Board(port) = &address else {
        let message = "only a board takes a world: hapt:PATH with its serial port, such as hapt:/dev/ttyACM0";
        return Err(Failure::input(format!("--device {}: {message}", args.device)));
    };
    let mut sets = args.world.sets.clone();
    sets.extend(address.overrides(&loaded.world)?);
    loaded.world = World::read(&loaded.source, &sets)?;
    let profile = address.profile(&loaded.world, args.uncertified)?;
    let packed = hapt_host::packed(&loaded.world, profile).map_err(Failure::input)?;
    flash(&loaded, &packed, port)
}

fn flash(loaded: &Loaded, packed: &[u8], port: &BoardPort) -> Result<ExitCode, Failure> {
    let mut link = port.open()?;
    if let Some(note) = link.board().note() {
        say(format_args!("note: {note}"));
    }
    let before = link.board().world;
    let hash = link.load(packed)?;
    let board = link.board();
    let what = if before == Some(hash) { "was there already" } else { "sent and verified" };
    let text = format!(
        "{}\nboard        {}, firmware {}\nworld        {} bytes, hash {hash:08x}: {what}\n",
        loaded.title(),
        board.name,
        board.firmware,
        packed.len(),
    );
    let mut out = stdout().lock();
    out.write_all(text.as_bytes()).and_then(|()| out.flush()).map_err(Failure::stdout)?;
    Ok(ExitCode::SUCCESS)
}
