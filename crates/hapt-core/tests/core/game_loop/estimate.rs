//! A game's law from its levels and a prescribed motion.

use hapt_core::wheel::game_loop::{GameLoop, GameReport, HostLevel, Oddity, Rotor};
use hapt_core::wheel::{Device, Timing};
use hapt_testing::cases;
use hapt_testing::prelude::*;

use super::free_wheel::{Dice, Game, Law, STEP};

const COUNT: f64 = std::f64::consts::TAU / 65_536.0;
const ROTOR: Rotor = Rotor { inertia: 0.03, damping: 0.05, friction: 0.0 };

fn device(period: f64) -> Device {
    Device { count: COUNT, ..Device::ideal(Timing { delay: 2e-4, ..Timing::even(period) }, 0.05, 10.0) }
}

/// The estimates while the wheel moves by `motion` and levels come from `levels`, by step; samples `period` steps apart.
fn found(
    period: usize,
    seconds: f64,
    mut motion: impl FnMut(f64) -> f64,
    mut levels: impl FnMut(usize, f64) -> f64,
) -> GameReport<f64> {
    let search = GameLoop::<f64>::new(&device(period as f64 * STEP), &ROTOR, false).unwrap();
    let mut state = search.start();
    let mut before = 0.0;
    for step in 0..(seconds / STEP) as usize {
        let z = motion(step as f64 * STEP);
        let level = levels(step, z);
        if step % period == 0 {
            let counted = (z / COUNT).round() * COUNT;
            let given = search.step(&mut state, counted, HostLevel { level, changed: level != before, torque: level });
            assert_eq!(given, 0.0, "it only measures");
            before = level;
        }
    }
    *state.report()
}

/// A hand's steering: slow turns and quicker corrections.
fn steering(dice: &mut Dice) -> impl FnMut(f64) -> f64 + use<> {
    let waves: Vec<[f64; 3]> = (0..4)
        .map(|n| {
            [dice.between(0.3, 0.8) / (1.0 + f64::from(n)), dice.between(0.3, 1.5) * f64::from(2 * n + 1), dice.roll()]
        })
        .collect();
    move |t| waves.iter().map(|[size, hertz, phase]| size * (std::f64::consts::TAU * (hertz * t + phase)).sin()).sum()
}

proptest! {
    #![proptest_config(cases(128))]

    #[test]
    fn stiffness_lateness_and_rate_are_within_what_is_said(seed in any::<u64>()) {
        let mut dice = Dice(seed);
        let stiffness = dice.between(0.5, 40.0);
        let hold = dice.steps(25, 166);
        let late = dice.steps(10, 590);
        let (period, seconds) = (dice.steps(4, 20), 4.0);
        let noise = dice.roll() * 0.05 * stiffness;
        let mut steers = steering(&mut dice);
        let mut game = Game::new(Law::Line(stiffness), [hold; 2], [late; 2]);
        let mut kerb = 0.0;
        let mut frames = Dice(seed ^ 1);
        let mut held = 0.0;
        let report = found(period, seconds, &mut steers, |step, z| {
            let level = game.torque(step, z, &mut dice);
            if level != held {
                held = level;
                // Grips of the road, from frame to frame.
                kerb = noise * (frames.roll() - 0.5);
            }
            level + kerb
        });
        let law = report.law.expect("a law");
        prop_assert!(law.stiffness_range[0] <= stiffness && stiffness <= law.stiffness_range[1], "{stiffness} {law:?}");
        // A level waits for the next sample.
        let [first, last] = law.lateness_range;
        let (least, most) = (late as f64 * STEP, (late + period) as f64 * STEP);
        prop_assert!(first <= most && last >= least, "{late} steps: {law:?}");
        prop_assert!(law.worst.0 * law.worst.1.cost() >= 0.97 * stiffness * (least + 0.5 * hold as f64 * STEP), "{late} {hold} {stiffness} {law:?}");
        prop_assert!((law.hold - hold as f64 * STEP).abs() < 1.1 * period as f64 * STEP, "{hold}: {law:?}");
        // The interval is narrow where the kerbs are not most of the levels.
        prop_assert!(law.explained < 0.9 || law.stiffness_range[1] < 1.5 * stiffness, "{stiffness} {law:?}");
        prop_assert!(law.explained < 0.9 || last < most + 15e-3, "{late}: {law:?}");
        // Slow motion may leave the largest lag open.
        prop_assert!(matches!(report.oddity, None | Some(Oddity::Late)), "{report:?}");
    }

    #[test]
    fn levels_that_have_nothing_to_do_with_the_motion_are_no_law(seed in any::<u64>()) {
        let mut dice = Dice(seed);
        let hold = dice.steps(25, 166);
        let mut steers = steering(&mut dice);
        let mut level = 0.0;
        let report = found(10, 3.0, &mut steers, |step, _| {
            if step % hold == 0 {
                level = 5.0 * (dice.roll() - 0.5);
            }
            level
        });
        prop_assert!(report.law.is_none_or(|law| law.explained < 0.5), "{report:?}");
    }
}

fn sine(t: f64) -> f64 {
    0.4 * (9.0 * t).sin() + 0.2 * (23.0 * t).sin()
}

#[test]
fn a_turned_sign_is_named() {
    let mut game = Game::new(Law::Line(-5.0), [100; 2], [150; 2]);
    let mut dice = Dice(3);
    let report = found(10, 2.0, sine, |step, z| game.torque(step, z, &mut dice));
    assert_eq!(report.oddity, Some(Oddity::Outward));
    assert!((report.law.unwrap().stiffness + 5.0).abs() < 0.5, "{report:?}");
    assert!(report.lacking > 0.05, "its lateness is counted as that of a spring");
}

#[test]
fn a_law_that_is_later_than_the_search_is_named() {
    let mut game = Game::new(Law::Line(5.0), [100; 2], [2600; 2]);
    let mut dice = Dice(3);
    let report =
        found(10, 2.0, |t| 0.5 * (4.0 * t).sin() + 0.1 * (9.0 * t).sin(), |step, z| game.torque(step, z, &mut dice));
    assert_eq!(report.oddity, Some(Oddity::Late), "{report:?}");
}

#[test]
fn levels_at_random_times_are_uneven() {
    let mut game = Game::new(Law::Line(5.0), [10, 400], [100; 2]);
    let mut dice = Dice(3);
    let report = found(10, 3.0, sine, |step, z| game.torque(step, z, &mut dice));
    assert_eq!(report.oddity, Some(Oddity::Uneven), "{report:?}");
}

#[test]
fn a_collision_does_not_change_what_is_known() {
    let law = |collides: bool| {
        let mut game = Game::new(Law::Line(5.0), [100; 2], [200; 2]);
        let mut dice = Dice(3);
        let hits = |step: usize| if collides && (15_000..16_000).contains(&step) { 8.0 } else { 0.0 };
        found(10, 1.8, sine, |step, z| game.torque(step, z, &mut dice) + hits(step)).law.unwrap()
    };
    let (plain, hit) = (law(false), law(true));
    assert!((plain.stiffness - hit.stiffness).abs() < 0.05 * plain.stiffness, "{plain:?} {hit:?}");
    assert!((plain.lateness - hit.lateness).abs() < 3e-3);
}

#[test]
fn nothing_is_forgotten_in_a_menu() {
    let mut game = Game::new(Law::Line(5.0), [100; 2], [200; 2]);
    let mut dice = Dice(3);
    let rests = |t: f64| if t < 2.0 { sine(t) } else { sine(2.0) };
    let mut last = 0.0;
    let report = found(10, 30.0, rests, |step, z| {
        if step < 25_000 {
            last = game.torque(step, z, &mut dice);
        }
        last
    });
    assert!((report.law.expect("a law").stiffness - 5.0).abs() < 0.2, "{report:?}");
}

#[test]
fn it_gives_the_same_bits_each_time_and_survives_any_number() {
    let run = || {
        let search = GameLoop::<f32>::new(&device(1e-3), &ROTOR, true).unwrap();
        let (mut state, mut dice, mut bits) = (search.start(), Dice(9), 0_u64);
        let wild = [f32::NAN, f32::INFINITY, -f32::INFINITY, f32::MAX, -f32::MAX, 0.0, 1e-40];
        for step in 0..20_000 {
            let number = |dice: &mut Dice| {
                if dice.roll() < 0.02 { wild[dice.steps(0, 6)] } else { (dice.roll() - 0.5) as f32 * 10.0 }
            };
            let (z, level, changed) = (number(&mut dice), number(&mut dice), dice.roll() < 0.5);
            let torque = search.step(&mut state, z, HostLevel { level, changed, torque: level });
            assert!(torque.is_finite(), "{step}");
            search.commanded(&mut state, number(&mut dice));
            bits = bits.rotate_left(7) ^ u64::from(torque.to_bits());
        }
        bits
    };
    assert_eq!(run(), run());
}

#[test]
fn a_wheel_without_inertia_is_refused_by_name() {
    for inertia in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let refused = GameLoop::<f64>::new(&device(1e-3), &Rotor { inertia, ..ROTOR }, true).unwrap_err();
        assert_eq!(refused.to_string(), "the wheel's inertia is out of range");
    }
}
