//! The wheel under a game's law, hands-off and hands-on.

use hapt_core::wheel::game_loop::{GameLoop, GameReport, HostLevel, Rotor};
use hapt_core::wheel::{Device, Effect, Timing, Wheel as Effects};
use hapt_testing::cases;
use hapt_testing::prelude::*;

use super::free_wheel::{Dice, Game, Law, STEP, Wheel};

/// A wheel, its loop, and a game.
#[derive(Clone, Copy, Debug)]
struct Rig {
    inertia: f64,
    damping: f64,
    limit: f64,
    count: f64,
    /// Steps of a period and of the delay.
    period: usize,
    delay: usize,
    law: Law,
    /// Steps.
    hold: usize,
    late: usize,
    acts: bool,
}

impl Rig {
    fn random(dice: &mut Dice) -> Self {
        let stiffness = dice.between(0.5, 40.0);
        Rig {
            inertia: dice.between(0.005, 0.1),
            damping: dice.between(0.01, 0.2),
            limit: dice.between(2.0, 20.0),
            count: std::f64::consts::TAU / dice.between(4e3, 1e6),
            period: dice.steps(4, 20),
            delay: dice.steps(0, 10),
            law: tyre(stiffness, dice),
            hold: dice.steps(25, 166),
            late: dice.steps(10, 500),
            acts: true,
        }
    }

    fn game_loop(&self) -> GameLoop<f64> {
        let rotor = Rotor { inertia: self.inertia, damping: self.damping, friction: 0.0 };
        GameLoop::new(&self.device(), &rotor, self.acts).unwrap()
    }

    fn device(&self) -> Device {
        let timing = Timing { delay: self.delay as f64 * STEP, ..Timing::even(self.period as f64 * STEP) };
        Device { count: self.count, ..Device::ideal(timing, self.damping, self.limit) }
    }
}

/// As games have them: straight, or bounded, or falling beyond a peak.
fn tyre(stiffness: f64, dice: &mut Dice) -> Law {
    let peak = dice.between(0.2, 3.0);
    match dice.steps(0, 2) {
        0 => Law::Line(stiffness),
        1 => Law::Bounded(stiffness, peak),
        _ => Law::Falling(stiffness, peak),
    }
}

/// The signals of a step.
struct Now {
    t: f64,
    v: f64,
    /// Of the game, as requested, and as given.
    level: f64,
    given: f64,
    report: GameReport<f64>,
}

/// The hand's torque by time, position and velocity.
fn play(rig: &Rig, seconds: f64, seed: u64, hand: impl Fn(f64, f64, f64) -> f64, sees: impl FnMut(&Now)) {
    let mut dice = Dice(seed);
    let mut game = Game::new(rig.law, [rig.hold; 2], [rig.late; 2]);
    levels(rig, seconds, |step, z| game.torque(step, z, &mut dice), hand, sees);
}

/// The same with levels of any kind, by step and position.
fn levels(
    rig: &Rig,
    seconds: f64,
    mut game: impl FnMut(usize, f64) -> f64,
    hand: impl Fn(f64, f64, f64) -> f64,
    mut sees: impl FnMut(&Now),
) {
    let (effects, game_loop) = (Effects::<f64>::new(&rig.device()).unwrap(), rig.game_loop());
    let (mut playing, mut steadied) = (effects.start(), game_loop.start());
    let mut wheel = Wheel { inertia: rig.inertia, damping: rig.damping, z: 0.0, v: 0.0 };
    let (mut level, mut revision, mut sent, mut torque) = (0.0, 0, Vec::new(), 0.0);
    for step in 0..(seconds / STEP) as usize {
        let t = step as f64 * STEP;
        let requested = game(step, wheel.z).clamp(-rig.limit, rig.limit);
        if step % rig.period == 0 {
            let counted = (wheel.z / rig.count).round() * rig.count;
            let jump = requested - level;
            level = requested;
            revision += u32::from(jump != 0.0);
            let added =
                game_loop.step(&mut steadied, counted, HostLevel { level, changed: jump != 0.0, torque: level });
            let given = effects.step(&mut playing, counted, &[Effect::Torque(level), Effect::Torque(added)], revision);
            game_loop.commanded(&mut steadied, given.torque);
            sent.push((step + rig.delay, given.torque));
        }
        while sent.first().is_some_and(|(arrives, _)| *arrives <= step) {
            torque = sent.remove(0).1;
        }
        wheel.go(torque + hand(t, wheel.z, wheel.v));
        sees(&Now { t, v: wheel.v, level, given: torque, report: *steadied.report() });
    }
}

/// A hand that steers for two seconds, pushes, and releases the wheel.
fn lets_go(rig: &Rig) -> impl Fn(f64, f64, f64) -> f64 + use<> {
    let inertia = rig.inertia;
    move |t, z, v| {
        if t < 2.0 {
            let wanted = 0.5 * (6.0 * t).sin() + 0.1 * (17.0 * t).sin();
            40.0 * (wanted - z) - 1.5 * v
        } else if t < 2.05 {
            // A kick of 2 rad/s.
            inertia * 2.0 / 0.05
        } else {
            0.0
        }
    }
}

/// The largest speeds in the second after the kick and in the last one of eight.
fn speeds(rig: &Rig, seed: u64) -> [f64; 2] {
    let mut speeds = [0.0_f64; 2];
    play(rig, 8.0, seed, lets_go(rig), |now| {
        if now.t > 2.05 {
            let place = if now.t < 3.05 {
                Some(0)
            } else if now.t > 7.0 {
                Some(1)
            } else {
                None
            };
            if let Some(place) = place {
                speeds[place] = speeds[place].max(now.v.abs());
            }
        }
    });
    speeds
}

proptest! {
    #![proptest_config(cases(256))]

    #[test]
    fn a_wheel_that_is_let_go_gets_quiet(seed in any::<u64>()) {
        let rig = Rig::random(&mut Dice(seed));
        let [first, last] = speeds(&rig, seed);
        prop_assert!(last <= first.max(2.0), "{rig:?}: {first} rad/s, later {last}");
    }
}

/// The largest speeds of a wheel that is kicked and released, in the second after the kick and in the last of twenty; the game sees the
/// angle through a low-pass of this time, as by the response of a car to the steering.
fn speeds_behind(lag: f64, rig: &Rig, seed: u64) -> [f64; 2] {
    let (mut dice, mut seen) = (Dice(seed), 0.0);
    let mut game = Game::new(rig.law, [rig.hold; 2], [rig.late; 2]);
    let inertia = rig.inertia;
    let kick = move |t: f64, _: f64, _: f64| if t < 0.05 { inertia * 2.0 / 0.05 } else { 0.0 };
    let [mut first, mut last] = [0.0_f64; 2];
    let levels_of = |step: usize, z: f64| {
        seen += STEP / lag * (z - seen);
        game.torque(step, seen, &mut dice)
    };
    levels(rig, 20.0, levels_of, kick, |now| {
        let place = if now.t < 1.0 { &mut first } else { &mut last };
        if now.t < 1.0 || now.t > 19.0 {
            *place = place.max(now.v.abs());
        }
    });
    [first, last]
}

proptest! {
    #![proptest_config(cases(64))]

    #[test]
    fn a_wheel_whose_game_answers_slowly_does_not_grow(seed in any::<u64>()) {
        let mut dice = Dice(seed);
        let (rig, lag) = (Rig::random(&mut dice), dice.between(0.02, 0.3));
        let [first, last] = speeds_behind(lag, &rig, seed);
        prop_assert!(last <= 1.01 * first.max(2.0), "{lag} s behind, {rig:?}: {first} rad/s, later {last}");
    }
}

#[test]
fn a_game_that_answers_slowly_grows_without_a_remedy_and_is_quiet_with_it() {
    let grown = speeds_behind(0.2, &Rig { law: Law::Line(4.0), acts: false, ..RIG }, 1);
    let quiet = speeds_behind(0.2, &Rig { law: Law::Line(4.0), ..RIG }, 1);
    assert!(grown[1] > 5.0 && quiet[1] < 0.2, "{grown:?} {quiet:?}");
}

#[test]
fn the_game_of_the_documentation_grows_without_it_and_is_quiet_with_it() {
    let rig = Rig {
        inertia: 0.03,
        damping: 0.05,
        limit: 10.0,
        count: std::f64::consts::TAU / 65_536.0,
        period: 10,
        delay: 2,
        law: Law::Line(10.0),
        hold: 167,
        late: 160,
        acts: false,
    };
    let [_, grown] = speeds(&rig, 1);
    assert!(grown > 3.0, "{grown}");
    let [first, quiet] = speeds(&Rig { acts: true, ..rig }, 1);
    assert!(first < 10.0 && quiet < 0.1, "{first} {quiet}");
}

#[test]
fn with_hands_on_the_torque_is_the_games() {
    let rig = Rig {
        inertia: 0.03,
        damping: 0.05,
        limit: 10.0,
        count: std::f64::consts::TAU / 65_536.0,
        period: 10,
        delay: 2,
        law: Law::Bounded(10.0, 0.4),
        hold: 167,
        late: 160,
        acts: true,
    };
    let (mut off, mut all, mut plain) = (0.0, 0.0, Vec::new());
    let hand = |t: f64, z: f64, v: f64| 40.0 * (0.6 * (5.0 * t).sin() + 0.1 * (14.0 * t).sin() - z) - 1.0 * v;
    play(&Rig { acts: false, ..rig }, 6.0, 1, hand, |now| plain.push(now.given));
    let mut plain = plain.into_iter();
    play(&rig, 6.0, 1, hand, |now| {
        let requested = plain.next().unwrap();
        if now.t > 1.0 {
            off += (now.given - requested) * (now.given - requested);
            all += now.level * now.level;
        }
    });
    let error = (off / all).sqrt();
    assert!(error < 0.05, "{error}");
}

const RIG: Rig = Rig {
    inertia: 0.03,
    damping: 0.05,
    limit: 10.0,
    count: std::f64::consts::TAU / 65_536.0,
    period: 10,
    delay: 2,
    law: Law::Line(10.0),
    hold: 167,
    late: 160,
    acts: true,
};

/// A wheel that is kicked, and released.
fn kicked(t: f64, _: f64, _: f64) -> f64 {
    if t < 0.05 { RIG.inertia * 2.0 / 0.05 } else { 0.0 }
}

/// The largest speed of the last second of eight, and the last report.
fn at_last(rig: &Rig, game: impl FnMut(usize, f64) -> f64) -> (f64, GameReport<f64>) {
    let (mut most, mut report) = (0.0_f64, GameReport::NOTHING);
    levels(rig, 8.0, game, kicked, |now| {
        if now.t > 7.0 {
            most = most.max(now.v.abs());
        }
        assert!(now.given.abs() <= rig.limit);
        report = now.report;
    });
    (most, report)
}

#[test]
fn levels_beside_any_law_make_the_wheel_no_faster_than_without_a_remedy() {
    type Levels = fn(usize, f64, &mut f64) -> f64;
    let streams: [(&str, Levels); 4] = [
        ("random", |step, _, held| {
            if step % 100 == 0 {
                *held = Dice(step as u64 * 7919 + 1).roll() * 10.0 - 5.0;
            }
            *held
        }),
        ("the integral of the motion", |_, z, held| {
            *held -= 20.0 * z * STEP;
            *held
        }),
        ("the sign of the position", |_, z, _| -3.0 * z.signum()),
        ("a turned sign", |step, z, held| {
            if step % 100 == 0 {
                *held = 5.0 * z;
            }
            *held
        }),
    ];
    for (name, stream) in streams {
        let run = |acts: bool| {
            let mut held = 0.0;
            at_last(&Rig { acts, ..RIG }, |step, z| stream(step, z, &mut held))
        };
        let ((plain, _), (remedied, report)) = (run(false), run(true));
        assert!(remedied <= 1.1 * plain + 0.01, "{name}: {remedied} rad/s, without {plain}: {report:?}");
    }
}

#[test]
fn a_game_that_falls_silent_keeps_no_remedy() {
    let mut dice = Dice(1);
    let mut game = Game::new(RIG.law, [RIG.hold; 2], [RIG.late; 2]);
    let mut held = 0.0;
    let (_, report) = at_last(&RIG, |step, z| {
        if step < 20_000 {
            held = game.torque(step, z, &mut dice);
        }
        held
    });
    assert!(report.law.is_some() && report.damping == 0.0 && report.held_back == 0.0, "{report:?}");
}

#[test]
fn no_torque_steps_by_more_than_its_slew() {
    let (mut before, mut most) = (0.0, 0.0_f64);
    play(&RIG, 6.0, 1, lets_go(&RIG), |now| {
        most = most.max((now.report.torque - before).abs());
        before = now.report.torque;
    });
    // The slew of a rising remedy, and that of the damper on a wheel that the whole torque accelerates.
    let period = RIG.period as f64 * STEP;
    let slew = RIG.limit / 0.05 * period + 0.4 * 2.0 * RIG.limit / RIG.inertia * period;
    assert!(most < slew, "{most} of {slew}");
}

#[test]
fn counts_make_no_buzz() {
    for counts in [4096.0, 65_536.0] {
        let rig = Rig { count: std::f64::consts::TAU / counts, ..RIG };
        let mut most = 0.0_f64;
        // Released, and then at rest: the game's own last level holds the wheel away from the middle of a count.
        play(&rig, 12.0, 1, lets_go(&rig), |now| {
            if now.t > 10.0 {
                most = most.max(now.report.torque.abs());
            }
        });
        assert!(most < 0.05, "{counts}: {most} N m");
    }
}
