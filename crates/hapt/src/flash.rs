//! `hapt flash`: a world onto a board.

use std::io::{Write, stdout};
use std::process::ExitCode;

use crate::args::FlashArgs;
use crate::board::{self, Fit};
use crate::device::{Port, Spec};
use crate::failure::Failure;
use crate::world::load;

pub fn run(args: &FlashArgs) -> Result<ExitCode, Failure> {
    let loaded = load(&args.world)?;
    let spec: Spec =
        args.device.parse().map_err(|wrong| Failure::input(format!("--device {}: {wrong}", args.device)))?;
    let Spec::Board(port) = spec else {
        let message = "only a board takes a world: hapt:PATH with its serial port, such as hapt:/dev/ttyACM0";
        return Err(Failure::input(format!("--device {}: {message}", args.device)));
    };
    let fit = Fit::new(loaded, &args.world.sets, args.uncertified)?;
    flash(&fit, &port)
}

fn flash(fit: &Fit, port: &Port) -> Result<ExitCode, Failure> {
    let mut link = board::open(port)?;
    let before = link.board().world;
    let hash = link.load(&fit.packed)?;
    let board = link.board();
    let what = if before == Some(hash) { "was there already" } else { "sent and verified" };
    let text = format!(
        "{}\nboard        {}, firmware {}\nworld        {} bytes, hash {hash:08x}: {what}\n",
        fit.loaded.title(),
        board.name,
        board.firmware,
        fit.packed.len(),
    );
    let mut out = stdout().lock();
    out.write_all(text.as_bytes()).and_then(|()| out.flush()).map_err(Failure::stdout)?;
    Ok(ExitCode::SUCCESS)
}
