//! What stands in the way where a goal is missed, as callgrind and `perf record` have it: to be looked at again when the code changes.

pub(super) const RUN_MISSED: &str = "
What stands in the way: instructions. C needs about 50 for a released sample and 40 for a held one (built without AVX-512, which
callgrind does not know); hapt needs those of the table below. Of a released sample's 302, the puck's motion with its works takes 63, the
loop's step 83, `Simulation::next` 95, of which 20 ask whether all numbers are finite, and the fourteen columns 75. About half are arithmetic. The
others write the numbers into the row that is lent, and from there into the caller's columns, keep time and memory for a state that anybody
may take, and ask what remains to be asked: whether the next event has come, whether the loop is a usual one of one body, whether samples
are uneven, whether the motor delays or lags. What a period is (hand, friction, lag, delay, shaft), the device asks once, until the hand or
the device changes. Fewer instructions are not always less time: compiled into its caller the sample takes 284 and was 1.3 to 1.4 times as slow. To come near the bound, which is a single sum's waiting, device, loop
and columns would have to be compiled as one for their world, as C's are: a form of the run for each kind of device, which takes its time
at every compilation of hapt-sim.
";

pub(super) const STEP_MISSED: &str = "
What stands in the way, in instructions a sample of hapt and of C for any machine: one body 50 and 46, two 84 and 102, four 230 and 335,
eight 744 and 652, 32 8614 and 10 294. With one body hapt asks two questions (a usual world, one body) and one about the limit, and keeps
its state in memory, where C's loop keeps it in registers; the others of its 50 are the arithmetic. 2, 4 and 8 bodies have rooms of their own; 16 stand in the
room of 32, where the sums of 24 places are made. ExternalTorqueInput `-march=native` the width of the vectors is what is left: C has vectors of eight
numbers where hapt has two, and fuses multiplication and addition, which hapt may not, as the bits would depend on the machine. Built for
this machine hapt gets vectors of four.
";

pub(super) const START_MISSED: &str = "
What stands in the way: page faults, as `perf record -e page-faults` has them. Of the time beyond the empty program's somewhat less than half is
theirs, three to four microseconds each. 76 come where the loader writes the addresses of 14 400 pointers into 290 kB of constants (places
of panics, tables of functions, names): each is small, so that there is no large table to be made late. 60 are code, in a program of 20 MB, 60
the system's libraries, 30 the heap and 20 the stack. A program at a fixed address would have no such pointers and start a seventh sooner;
it would also have its code where an attacker expects it, and hapt serves pages and reads the files of others. Packed
relocations (RELR) save the table's 350 kB, and no fault, and need a system of 2022. Of 1.5 million instructions a third are the loader's and a
sixth read the world file; the rest is the start of the standard library, the command line, the file's units, the signals' thread, one
sample and its text.
";

pub(super) const CSV_MISSED: &str = "
What stands in the way: the printer writes into a buffer of its own, from where every number is copied into the line, and every line
into the output.
";
