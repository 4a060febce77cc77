//! The page of `hapt wheel --page` without the kernel: this program is the computer that the simulated wheel is plugged into.
//!
//! It prints the page's link, and then the page's pedals and buttons, as `pressed THROTTLE BRAKE CLUTCH BUTTONS`. Its input: `torque SHARE`,
//! `sine SHARE`, `spring SHARE`, `damper SHARE`, `friction SHARE` or `inertia SHARE` plays an effect of this part of full scale, `free` ends all
//! effects, and `unplug` removes the wheel. The end of the input ends the program. The page's own test runs it (`web/test/wheel.test.mjs`).
//!
//! `cargo run --profile test --workspace --example wheel_page`

#[cfg(target_os = "linux")]
#[allow(dead_code)] // Only a part of the host is used here.
#[path = "../../hapt-host/tests/game_wheel/host.rs"]
mod host;

/// The longest wait of the host for an answer.
#[cfg(target_os = "linux")]
const TEST_TIMEOUT: std::time::Duration = std::time::Duration::from_secs(60);

#[cfg(not(target_os = "linux"))]
fn main() {
    println!("there is no wheel for games but on Linux");
}

#[cfg(target_os = "linux")]
fn main() -> Result<(), Box<dyn std::error::Error>> {
    use std::io::BufRead;
    use std::os::unix::net::UnixStream;
    use std::sync::mpsc::{TryRecvError, channel};
    use std::time::Duration;

    use hapt_host::Machine;
    use hapt_host::game_wheel::{GameWheel, Room};
    use hapt_live::{Live, Options};
    use hapt_model::builtin;
    use hapt_rt::Outside;
    use hapt_wire::pid::{Report, id};

    let (own, other) = UnixStream::pair()?;
    let options = Options {
        worlds: vec![builtin::source("@devices/game-wheel")?],
        sets: vec!["safety.late=count".into()],
        address: "127.0.0.1:0".parse()?,
        token: false,
        folder: std::env::args_os().nth(1).unwrap_or_else(|| ".".into()).into(),
    };
    let mut wheel = None;
    let live = Live::start_on(options, |world| {
        let room = Room::of(world, 5.0 * std::f64::consts::PI)?;
        let (attached, effects) = GameWheel::on(own, &room)?;
        let machine =
            Machine::simulated(world).with_outside(Outside::playing(effects)).ok_or("no loop of this computer")?;
        let machine = Machine { wheel: Some(Box::new(attached.view())), ..machine };
        wheel = Some(attached);
        Ok::<_, Box<dyn std::error::Error>>(machine)
    })?;
    println!("{}", live.link());

    let (sender, lines) = channel();
    std::thread::spawn(move || {
        std::io::stdin().lock().lines().map_while(Result::ok).all(|line| sender.send(line).is_ok())
    });
    let mut host = host::Host::new(other);
    host.configure();
    let (mut blocks, mut pressed) = (Vec::new(), Vec::new());
    loop {
        match lines.try_recv() {
            Ok(line) if line == "free" => blocks.drain(..).for_each(|block| host.report(Report::Free { block })),
            Ok(line) if line == "unplug" => break,
            Ok(line) => blocks.push(play(&mut host, &line)?),
            Err(TryRecvError::Disconnected) => return Ok(()),
            Err(TryRecvError::Empty) => live.wait(Duration::from_millis(20))?,
        }
        // Any transfer collects the wheel's positions so far.
        host.feature(id::POOL);
        for shown in host.shown.drain(..).filter(|shown| shown.len() == 11) {
            if pressed != shown[3..] {
                pressed = shown[3..].to_vec();
                let word = |at: usize| u16::from_le_bytes([pressed[at], pressed[at + 1]]);
                println!("pressed {} {} {} {}", word(0), word(2), word(4), word(6));
            }
        }
    }
    // The page shows that the wheel is detached.
    drop(host);
    while lines.recv().is_ok() {}
    Ok(())
}

/// Plays the effect of a line; returns its place.
#[cfg(target_os = "linux")]
fn play(host: &mut host::Host, line: &str) -> Result<usize, Box<dyn std::error::Error>> {
    use hapt_wire::pid::{Condition, FULL, Kind, Periodic, Report};

    let (kind, share) = line.split_once(' ').ok_or("an effect and its share of full scale")?;
    let level = (share.parse::<f64>()?.clamp(-1.0, 1.0) * f64::from(FULL)) as i16;
    let condition = |block| {
        let (most, axis) = (FULL, 0);
        let numbers = Condition {
            positive: level,
            negative: level,
            positive_saturation: most,
            negative_saturation: most,
            ..Condition::default()
        };
        Report::Condition { block, axis, condition: numbers }
    };
    Ok(match kind {
        "torque" => host.play(Kind::Constant, |block| Report::Constant { block, magnitude: level }),
        "sine" => {
            let periodic = Periodic { magnitude: level, offset: 0, phase: 0, period: 1500 };
            host.play(Kind::Sine, |block| Report::Periodic { block, periodic })
        }
        "spring" => host.play(Kind::Spring, condition),
        "damper" => host.play(Kind::Damper, condition),
        "friction" => host.play(Kind::Friction, condition),
        "inertia" => host.play(Kind::Inertia, condition),
        _ => return Err(format!("{kind} is no effect").into()),
    })
}
