//! The damping that a game's law requires: with it the free wheel gains no energy.

use hapt_core::wheel::game_loop::{Damper, HostTime};
use hapt_testing::cases;
use hapt_testing::prelude::*;

use super::free_wheel::{Dice, Game, Law, STEP, Wheel};

/// The energy of the wheel and of the game's law, relative to the kick's, at most in `steps`.
fn energy(wheel: Wheel, game: &mut Game, steps: usize, dice: &mut Dice) -> f64 {
    let (mut wheel, mut most) = (wheel, 0.0_f64);
    let start = 0.5 * wheel.inertia * wheel.v * wheel.v;
    for step in 0..steps {
        let torque = game.torque(step, wheel.z, dice);
        wheel.go(torque);
        most = most.max((0.5 * wheel.inertia * wheel.v * wheel.v + game.law.energy(wheel.z)) / start);
    }
    most
}

fn time(hold: usize, late: usize) -> HostTime<f64> {
    HostTime { hold: hold as f64 * STEP, lateness: late as f64 * STEP }
}

proptest! {
    #![proptest_config(cases(256))]

    #[test]
    fn a_wheel_that_pays_for_a_late_law_gains_no_energy(seed in any::<u64>(), even in any::<bool>()) {
        let mut dice = Dice(seed);
        let stiffness = dice.between(0.1, 100.0);
        let law = Law::random(stiffness, &mut dice);
        let (hold, late) = (dice.steps(10, 200), dice.steps(0, 600));
        let least = dice.steps(0, late);
        let time = time(hold, late);
        let (holds, cost) = if even { ([hold; 2], time.cost()) } else { ([1, hold], time.oldest()) };
        let mut game = Game::new(law, holds, [least, late]);
        let wheel = Wheel { inertia: dice.between(1e-3, 1.0), damping: stiffness * cost, z: 0.0, v: dice.between(0.1, 10.0) };
        let most = energy(wheel, &mut game, 20_000, &mut dice);
        prop_assert!(most <= 1.0 + 1e-9, "{law:?} at {hold} steps, {late} late, gains up to {most}");
    }

    #[test]
    fn a_damper_that_pays_keeps_the_wheel_quiet(seed in any::<u64>()) {
        let mut dice = Dice(seed);
        let (hold, late, device) = (dice.steps(10, 200), dice.steps(0, 600), dice.between(1e-3, 0.1));
        let (period, delay) = (dice.steps(2, 20), dice.steps(0, 20));
        let damper = Damper {
            damping: dice.between(0.01, 5.0),
            inertia: dice.between(2e-3, 0.2),
            period: period as f64 * STEP,
            delay: delay as f64 * STEP,
            lag: 0.0,
            smoothing: if dice.roll() < 0.5 { 0.0 } else { dice.between(1e-4, 2e-2) },
        };
        let stiffness = damper.stiffness(device, &time(hold, late));
        prop_assume!(stiffness > 0.0);
        let law = Law::random(stiffness, &mut dice);
        let mut game = Game::new(law, [hold; 2], [dice.steps(0, late), late]);
        let mut wheel = Wheel { inertia: damper.inertia, damping: device, z: 0.0, v: 0.0 };
        let (mut velocity, mut last, mut rendered, mut sent) = (0.0, 0.0, 0.0, Vec::new());
        let share = damper.period / (damper.period + damper.smoothing);
        // The storage of (T68) while nothing else acts on the wheel.
        let mut storages = Vec::new();
        let steps = 30_000;
        for step in 0..steps {
            if step % period == 0 {
                velocity += share * ((wheel.z - last) / damper.period - velocity);
                last = wheel.z;
                sent.push((step + delay, -damper.damping * velocity));
            }
            while sent.first().is_some_and(|(arrives, _)| *arrives <= step) {
                rendered = sent.remove(0).1;
            }
            let push = if step < 500 { (step as f64 * STEP * 62.8).sin() } else { 0.0 };
            let torque = game.torque(step, wheel.z, &mut dice);
            wheel.go(torque + rendered + push);
            storages.push(0.5 * wheel.inertia * wheel.v * wheel.v + law.energy(wheel.z));
        }
        // After the torques that were in flight at the end of the push.
        let of = |from: usize, to: usize| storages[from..to].iter().fold(0.0_f64, |a, b| a.max(*b));
        let (before, after) = (of(0, 6000), of(20_000, steps));
        prop_assert!(after <= before * (1.0 + 1e-9), "{damper:?}, {law:?}: {before} grows to {after}");
    }
}

#[test]
fn a_heavy_wheel_with_two_percent_less_grows() {
    for (hold, late) in [(160, 0), (160, 160), (100, 500), (30, 300)] {
        let time = time(hold, late);
        let stiffness = 10.0;
        // An inertia for which the lateness is a twentieth of a radian.
        let inertia = stiffness * (time.oldest() / 0.05) * (time.oldest() / 0.05);
        let grows = |share: f64| {
            let wheel = Wheel { inertia, damping: share * stiffness * time.cost(), z: 0.0, v: 1.0 };
            energy(wheel, &mut Game::new(Law::Line(stiffness), [hold; 2], [late; 2]), 2_000_000, &mut Dice(1)) > 1.05
        };
        assert!(grows(0.98), "{hold} steps, {late} late");
        assert!(!grows(1.0));
    }
}

#[test]
fn a_law_without_delay_costs_nothing_and_a_damper_only_helps() {
    let at_once = HostTime { hold: 0.0, lateness: 0.0 };
    let none = Damper { damping: 0.0, inertia: 0.03, period: 1e-3, delay: 5e-4, lag: 0.0, smoothing: 0.0 };
    assert_eq!(none.stiffness(0.05, &at_once), f64::MAX);
    let late = HostTime { hold: 1.0 / 60.0, lateness: 0.016 };
    let bare = none.stiffness(0.05, &late);
    assert!((bare - 0.05 / late.cost()).abs() < 1e-12);
    let mut before = bare;
    for tenths in 1..20 {
        let more = Damper { damping: 0.1 * f64::from(tenths), ..none }.stiffness(0.05, &late);
        assert!(more > before, "{tenths}");
        before = more;
    }
    // The stiffness that a damper of B allows is less than 2 % below that of an ideal damper.
    let ideal = (0.05 + 1.0) / late.cost();
    let found = Damper { damping: 1.0, ..none }.stiffness(0.05, &late);
    assert!(found < ideal && found > 0.98 * ideal, "{found} of {ideal}");
}
