//! The reports of a force-feedback wheel, its pool of effects, and the free wheel under them.

use std::collections::BTreeMap;

use hapt_core::wheel::{Device, Effect, Sides, Timing, Wheel};
use hapt_plant::{VirtualDevice, spec::DeviceSpec};
use hapt_testing::prelude::*;
use hapt_wire::pid::{
    Common, Condition, Control, DESCRIPTOR, EFFECTS, Envelope, FULL, INFINITE, Kind, LONGEST_REPORT, Operation,
    Periodic, Pool, Report, SILENCE, Scale, id,
};

const SCALE: Scale = Scale { torque: 5.0, angle: 7.85, velocity: 20.0, acceleration: 200.0 };

/// The bits of each report, by whether it is an input, an output or a feature, and its id.
fn bits() -> BTreeMap<(u8, u8), u32> {
    let (mut rest, mut all, mut size, mut count, mut report, mut depth) = (DESCRIPTOR, BTreeMap::new(), 0, 0, 0, 0);
    while let [head, after @ ..] = rest {
        let length = [0, 1, 2, 4][usize::from(head & 3)];
        let value = after[..length].iter().rev().fold(0_u32, |value, byte| value << 8 | u32::from(*byte));
        match head & 0xfc {
            0x74 => size = value,
            0x94 => count = value,
            0x84 => report = value as u8,
            tag @ (0x80 | 0x90 | 0xb0) => *all.entry((tag, report)).or_default() += size * count,
            0xa0 => depth += 1,
            0xc0 => depth -= 1,
            _ => {}
        }
        rest = &after[length..];
    }
    assert_eq!(depth, 0, "a collection is left open");
    all
}

fn blocks() -> impl Strategy<Value = usize> {
    0..EFFECTS
}

fn kinds() -> impl Strategy<Value = Kind> {
    (0..Kind::ALL.len()).prop_map(|at| Kind::ALL[at])
}

fn reports() -> impl Strategy<Value = Report> {
    let (level, share, angle) = (-FULL..=FULL, 0..=FULL, 0..36_000_u16);
    let effect =
        (blocks(), kinds(), any::<[u16; 3]>(), share.clone(), any::<u8>(), proptest::option::of(angle.clone()));
    let conditions = (level.clone(), level.clone(), level.clone(), share.clone(), share.clone(), share.clone());
    prop_oneof![
        effect.prop_map(|(block, kind, [duration, repeat, delay], gain, button, direction)| {
            Report::Effect { block, common: Common { kind, duration, repeat, delay, gain, button, direction } }
        }),
        (blocks(), share.clone(), share.clone(), any::<[u16; 2]>()).prop_map(
            |(block, attack_level, fade_level, [attack_time, fade_time])| {
                Report::Envelope { block, envelope: Envelope { attack_level, fade_level, attack_time, fade_time } }
            }
        ),
        (blocks(), 0..2_u8, conditions).prop_map(|(block, axis, c)| {
            let (offset, positive, negative, positive_saturation, negative_saturation, dead_band) = c;
            let condition =
                Condition { offset, positive, negative, positive_saturation, negative_saturation, dead_band };
            Report::Condition { block, axis, condition }
        }),
        (blocks(), level.clone(), level.clone(), angle, any::<u16>()).prop_map(
            |(block, magnitude, offset, phase, period)| {
                Report::Periodic { block, periodic: Periodic { magnitude, offset, phase, period } }
            }
        ),
        (blocks(), level.clone()).prop_map(|(block, magnitude)| Report::Constant { block, magnitude }),
        (blocks(), level.clone(), level).prop_map(|(block, start, end)| Report::Ramp { block, start, end }),
        (blocks(), 0..3_usize, any::<u8>()).prop_map(|(block, at, loops)| {
            let operation = [Operation::Start, Operation::StartSolo, Operation::Stop][at];
            Report::Operation { block, operation, loops }
        }),
        blocks().prop_map(|block| Report::Free { block }),
        (0..6_usize).prop_map(|at| {
            use Control::{Continue, Disable, Enable, Pause, Reset, StopAll};
            Report::Control([Enable, Disable, StopAll, Reset, Pause, Continue][at])
        }),
        share.prop_map(Report::Gain),
        kinds().prop_map(Report::Create),
    ]
}

#[test]
fn the_descriptor_states_the_lengths_of_the_reports() {
    let bits = bits();
    assert!(bits.values().all(|bits| bits % 8 == 0), "{bits:?}");
    let bytes = |tag, report| bits[&(tag, report)] / 8 + 1;
    assert_eq!(bytes(0x80, id::WHEEL), 1 + 4 * 2 + 2);
    let pool = Pool::new();
    for report in [id::LOAD, id::POOL] {
        assert_eq!(bytes(0xb0, report) as usize, pool.feature(report).unwrap().len());
    }
    assert_eq!(bytes(0xb0, id::CREATE), 2);
    let longest = bits.iter().filter(|((tag, _), _)| *tag == 0x90).map(|(_, bits)| bits / 8 + 1).max();
    assert_eq!(longest, Some(LONGEST_REPORT as u32));
}

proptest! {
    #[test]
    fn a_report_is_read_as_it_was_written_in_the_length_of_the_descriptor(report in reports()) {
        let (bytes, length) = report.write();
        prop_assert_eq!(Report::read(&bytes[..length]), Some(report));
        prop_assert_eq!(Report::read(&bytes[..length - 1]), None);
        let tag = if bytes[0] == id::CREATE { 0xb0 } else { 0x90 };
        prop_assert_eq!(bits()[&(tag, bytes[0])] / 8 + 1, length as u32);
    }

    #[test]
    fn for_any_reports_the_effects_are_finite_and_a_stop_ends_them(
        bytes in proptest::collection::vec(proptest::collection::vec(any::<u8>(), 0..20), 0..20),
        reports in proptest::collection::vec(reports(), 0..100),
        step in 0..100_000_u64,
    ) {
        let mut pool = Pool::new();
        let mut now = 0;
        let read = bytes.iter().filter_map(|bytes| Report::read(bytes));
        for report in read.chain(reports) {
            pool.take(&report, now);
            now += step;
            pool.press((now & 0xffff) as u16, now);
            let (effects, count) = pool.effects(now, &SCALE);
            for effect in &effects[..count] {
                if let Effect::Torque(torque) = effect {
                    // A periodic's offset adds to its magnitude.
                    prop_assert!(torque.abs() <= 2.001 * SCALE.torque, "{torque}");
                }
            }
        }
        pool.stop_all();
        prop_assert_eq!(pool.effects(now, &SCALE).1, 0);
    }
}

/// A pool in which one effect plays from 0 on.
fn playing(kind: Kind, reports: &[Report], loops: u8) -> Pool {
    let mut pool = Pool::new();
    assert!(pool.take(&Report::Create(kind), 0));
    for report in reports {
        assert!(pool.take(report, 0));
    }
    assert!(pool.take(&Report::Operation { block: 0, operation: Operation::Start, loops }, 0));
    pool
}

fn torque(pool: &mut Pool, ms: u64) -> Option<f32> {
    match pool.effects(1000 * ms, &SCALE) {
        ([Effect::Torque(torque), ..], 1) => Some(torque),
        _ => None,
    }
}

fn common(kind: Kind, duration: u16) -> Common {
    Common { kind, duration, repeat: 0, delay: 10, gain: FULL / 2, button: 0, direction: None }
}

#[test]
fn an_effect_plays_after_its_delay_in_its_loops_with_its_gain_and_direction() {
    let effect = Report::Effect { block: 0, common: Common { direction: Some(27_000), ..common(Kind::Constant, 100) } };
    let mut pool = playing(Kind::Constant, &[effect, Report::Constant { block: 0, magnitude: FULL }], 3);
    for (ms, expected) in [(9, None), (10, Some(2.5)), (309, Some(2.5)), (310, None), (311, None)] {
        assert_eq!(torque(&mut pool, ms), expected, "at {ms} ms");
    }
}

#[test]
fn an_effect_of_65535_ms_has_no_end_until_it_is_stopped() {
    let effect = Report::Effect { block: 0, common: common(Kind::Constant, INFINITE) };
    let mut pool = playing(Kind::Constant, &[effect, Report::Constant { block: 0, magnitude: FULL }], 1);
    for ms in (0..100).map(|turn| 10 + 5000 * turn) {
        assert_eq!(torque(&mut pool, ms), Some(-2.5));
        // Any report counts.
        pool.take(&Report::Gain(FULL), 1000 * ms);
    }
    pool.take(&Report::Control(Control::StopAll), 0);
    assert_eq!(torque(&mut pool, 1_000_000_001), None);
}

/// The longest duration that 16 bits of milliseconds can encode.
#[test]
fn the_longest_effect_with_an_end_has_it_after_65534_ms_and_one_of_no_length_has_none() {
    let ends = |duration| {
        let effect = Report::Effect { block: 0, common: Common { delay: 0, ..common(Kind::Spring, duration) } };
        let condition = Condition { positive: FULL, negative: FULL, ..Condition::default() };
        let mut pool = playing(Kind::Spring, &[effect, Report::Condition { block: 0, axis: 0, condition }], 1);
        let mut plays = |ms: u64| pool.effects(1000 * ms, &SCALE).1 == 1;
        (0..200_000).find(|ms| !plays(*ms))
    };
    for (duration, end) in [(1, Some(1)), (INFINITE - 1, Some(65_534)), (INFINITE, None), (0, None)] {
        assert_eq!(ends(duration), end, "{duration} ms");
    }
}

#[test]
fn effects_that_can_do_work_pause_while_the_host_is_silent_and_the_others_stay() {
    let moving = Condition { offset: FULL / 2, positive: FULL, negative: FULL, ..Condition::default() };
    let still = Condition { offset: 0, ..moving };
    for kind in Kind::ALL {
        for condition in [moving, still] {
            let reports = [Report::Condition { block: 0, axis: 0, condition }];
            let mut pool = playing(kind, &reports, 255);
            let plays = |pool: &mut Pool, now| pool.effects(now, &SCALE).1 == 1;
            assert!(plays(&mut pool, SILENCE), "{kind:?}");
            let is_passive = match kind {
                Kind::Spring | Kind::Inertia | Kind::Friction => true,
                Kind::Damper => condition == still,
                Kind::Constant | Kind::Ramp | Kind::Square | Kind::Sine => false,
                Kind::Triangle | Kind::SawtoothUp | Kind::SawtoothDown => false,
            };
            assert_eq!(plays(&mut pool, SILENCE + 1), is_passive, "{kind:?}");
            assert_eq!(pool.pauses(), !is_passive, "{kind:?}");
            pool.take(&Report::Gain(FULL), SILENCE + 2);
            assert!(plays(&mut pool, SILENCE + 3) && !pool.pauses(), "{kind:?}: the host is there again");
        }
    }
}

#[test]
fn an_effect_that_a_late_reset_has_removed_is_restored_by_its_own_report() {
    let mut pool = Pool::new();
    // The host has sent the reset first, on the slower pipe.
    pool.take(&Report::Create(Kind::Constant), 0);
    pool.take(&Report::Control(Control::Reset), 0);
    assert!(!pool.take(&Report::Constant { block: 0, magnitude: FULL }, 0));
    assert!(pool.take(&Report::Effect { block: 0, common: common(Kind::Constant, 100) }, 0));
    assert!(pool.take(&Report::Constant { block: 0, magnitude: FULL }, 0));
    assert!(pool.take(&Report::Operation { block: 0, operation: Operation::Start, loops: 1 }, 0));
    assert_eq!(torque(&mut pool, 10), Some(-2.5));
}

#[test]
fn waves_and_envelopes_have_their_closed_forms() {
    let periodic = Periodic { magnitude: FULL, offset: 0, phase: 9000, period: 80 };
    let envelope = Envelope { attack_level: 0, fade_level: 0, attack_time: 20, fade_time: 40 };
    for (kind, wave) in [
        (Kind::Sine, (|x| (std::f32::consts::TAU * x).sin()) as fn(f32) -> f32),
        (Kind::Square, |x| if x < 0.5 { 1.0 } else { -1.0 }),
        (Kind::Triangle, |x| 1.0 - 4.0 * ((x + 0.25) % 1.0 - 0.5).abs()),
        (Kind::SawtoothUp, |x| 2.0 * x - 1.0),
        (Kind::SawtoothDown, |x| 1.0 - 2.0 * x),
    ] {
        let reports = [
            Report::Effect { block: 0, common: common(kind, 200) },
            Report::Periodic { block: 0, periodic },
            Report::Envelope { block: 0, envelope },
        ];
        let mut pool = playing(kind, &reports, 1);
        for t in 0..200_u16 {
            let t32 = f32::from(t);
            let level = (t32 / 20.0).min(1.0).min((200.0 - t32) / 40.0);
            let expected = -2.5 * level * wave((t32 / 80.0 + 0.25) % 1.0);
            let found = torque(&mut pool, u64::from(t) + 10).unwrap();
            assert!((found - expected).abs() < 1e-4, "{kind:?} at {t} ms: {found}, {expected}");
        }
    }
}

/// The wave of a kind at this time in turns, from 0 on.
fn wave(kind: Kind, turns: f64) -> f64 {
    let x = turns - turns.floor();
    match kind {
        Kind::Sine => (std::f64::consts::TAU * x).sin(),
        Kind::Square => 1.0 - 2.0 * f64::from(u8::from(x >= 0.5)),
        Kind::Triangle => 1.0 - 4.0 * ((x + 0.25) % 1.0 - 0.5).abs(),
        Kind::SawtoothUp => 2.0 * x - 1.0,
        Kind::SawtoothDown => 1.0 - 2.0 * x,
        Kind::Constant | Kind::Ramp | Kind::Spring | Kind::Damper | Kind::Inertia | Kind::Friction => 1.0,
    }
}

/// Whether a wave jumps within a part of a turn from here.
fn jumps(kind: Kind, turns: f64) -> bool {
    let near = |x: f64| (x - x.round()).abs() < 1e-3;
    match kind {
        Kind::Square => near(2.0 * turns),
        Kind::SawtoothUp | Kind::SawtoothDown => near(turns),
        _ => false,
    }
}

proptest! {
    /// Levels are of 10000, times of 1 ms, angles of 1/100°.
    #[test]
    fn torques_have_their_closed_forms_for_any_parameters(
        at in 0..7_usize,
        (magnitude, offset, start, end) in (-FULL..=FULL, -FULL..=FULL, -FULL..=FULL, -FULL..=FULL),
        (phase, period) in (0..36_000_u16, 2..2000_u16),
        (attack_level, fade_level, attack_time, fade_time) in (0..=FULL, 0..=FULL, 0..500_u16, 0..500_u16),
        (duration, delay, loops) in (1..2000_u16, 0..500_u16, 1..4_u8),
        (own, of_all, direction) in (0..=FULL, 0..=FULL, proptest::option::of(0..36_000_u16)),
        endless in any::<bool>(), ms in 0..8000_u64,
    ) {
        let kind = Kind::ALL[at];
        let duration = if endless { INFINITE } else { duration };
        let common = Common { kind, duration, repeat: 0, delay, gain: own, button: 0, direction };
        let reports = [
            Report::Gain(of_all),
            Report::Effect { block: 0, common },
            Report::Envelope { block: 0, envelope: Envelope { attack_level, fade_level, attack_time, fade_time } },
            Report::Constant { block: 0, magnitude },
            Report::Ramp { block: 0, start, end },
            Report::Periodic { block: 0, periodic: Periodic { magnitude, offset, phase, period } },
        ];
        let mut pool = playing(kind, &reports, loops);
        let found = torque(&mut pool, ms);
        let (delay, length) = (u64::from(delay), u64::from(duration));
        if ms < delay || (!endless && ms - delay >= length * u64::from(loops)) {
            prop_assert_eq!(found, None);
            return Ok(());
        }
        let t = (if endless { ms - delay } else { (ms - delay) % length }) as f64;
        let share = |level: i16| f64::from(level) / f64::from(FULL);
        let under = |level: f64| {
            let from = |edge: i16, passed: f64| level.signum() * share(edge) + (level - level.signum() * share(edge)) * passed;
            let left = length as f64 - t;
            if t < f64::from(attack_time) {
                from(attack_level, t / f64::from(attack_time))
            } else if !endless && left < f64::from(fade_time) {
                from(fade_level, left / f64::from(fade_time))
            } else {
                level
            }
        };
        let turns = t / f64::from(period) + f64::from(phase) / 36_000.0;
        let level = match kind {
            Kind::Constant => under(share(magnitude)),
            Kind::Ramp => under(share(start) + (share(end) - share(start)) * if endless { 0.0 } else { t / length as f64 }),
            _ => share(offset) + under(share(magnitude)) * wave(kind, turns),
        };
        // An effect of level 0 has an envelope of either sign.
        prop_assume!(level != 0.0 && share(magnitude) != 0.0 && !jumps(kind, turns));
        let right = direction.map_or(1.0, |angle| (f64::from(angle) * std::f64::consts::PI / 18_000.0).sin());
        let expected = -share(own) * share(of_all) * level * right * f64::from(SCALE.torque);
        let found = f64::from(found.unwrap());
        prop_assert!((found - expected).abs() < 2e-3 * f64::from(SCALE.torque), "{kind:?}: {found}, expected {expected}");
    }

    /// On a device with enough damping for every effect: at rest, at constant velocity, at a constant rate of the acceleration.
    #[test]
    fn conditions_have_their_closed_forms_for_any_parameters(
        at in 0..4_usize,
        (positive, negative) in (-FULL..=FULL, -FULL..=FULL),
        (positive_saturation, negative_saturation) in (0..=FULL, 0..=FULL),
        (offset, dead_band) in (-FULL..=FULL, 0..=FULL),
        (own, of_all) in (0..=FULL, 0..=FULL),
        x in -1.5..1.5_f64,
    ) {
        let kind = [Kind::Spring, Kind::Damper, Kind::Friction, Kind::Inertia][at];
        let condition = Condition { offset, positive, negative, positive_saturation, negative_saturation, dead_band };
        let reports = [
            Report::Gain(of_all),
            Report::Effect { block: 0, common: Common { gain: own, delay: 0, ..common(kind, INFINITE) } },
            Report::Condition { block: 0, axis: 0, condition },
            // A wheel has no second axis.
            Report::Condition { block: 0, axis: 1, condition: Condition { positive: 1, ..Condition::default() } },
        ];
        let mut pool = playing(kind, &reports, 1);
        let (effects, count) = pool.effects(1000, &SCALE);
        let timing = Timing::even(1e-3);
        let device = Device::ideal(timing, 20.0, 5.0);
        // The pool's numbers are f32; the wheel here is f64.
        let wide = effects[..count].iter().map(|effect| {
            let sides = |s: Sides<f32>| Sides {
                offset: s.offset.into(), dead_band: s.dead_band.into(), above: s.above.into(), below: s.below.into(),
                most_above: s.most_above.into(), most_below: s.most_below.into(),
            };
            match *effect {
                Effect::Spring(s) => Effect::Spring(sides(s)),
                Effect::Damper(s) => Effect::Damper(sides(s)),
                Effect::Friction(s) => Effect::Friction(sides(s)),
                Effect::Inertia(s) => Effect::Inertia(sides(s)),
                Effect::Torque(torque) => Effect::Torque(torque.into()),
            }
        });
        let effects: Vec<Effect<f64>> = wide.collect();
        let wheel = Wheel::<f64>::new(&device).unwrap();
        let mut state = wheel.start();
        let unit = f64::from(match kind { Kind::Spring => SCALE.angle, Kind::Damper => SCALE.velocity, _ => SCALE.acceleration });
        let path = |t: f64| match kind {
            Kind::Spring => x * unit,
            Kind::Inertia => x * unit * t * t * t / 6.0,
            _ => x * unit * t,
        };
        let mut torque = 0.0;
        for k in 0..=1000 {
            torque = wheel.step(&mut state, path(1e-3 * f64::from(k)), &effects, 0).torque;
        }
        let share = |level: i16| f64::from(level) / f64::from(FULL);
        let gain = share(own) * share(of_all);
        // The resisting torque, in parts of full scale. A driving coefficient counts as 0.
        let one = |coefficient: i16, x: f64, least: f64, most: f64| (share(coefficient).max(0.0) * x).clamp(least, most);
        let (above, below) = (share(positive_saturation), share(negative_saturation));
        let resisted = match kind {
            Kind::Friction if x > 0.0 => one(positive, 1.0, 0.0, above),
            Kind::Friction => one(negative, -1.0, -below, 0.0),
            Kind::Inertia => one(positive.min(negative), x, -above.min(below), above.min(below)),
            _ => {
                let x = x - share(offset);
                let beyond = x - x.clamp(-share(dead_band), share(dead_band));
                one(if beyond < 0.0 { negative } else { positive }, beyond, -below, above)
            }
        };
        let expected = (-gain * resisted * f64::from(SCALE.torque)).clamp(-5.0, 5.0);
        // The body follows a change of acceleration with a small delay.
        prop_assert!((torque - expected).abs() < 0.01 * f64::from(SCALE.torque), "{kind:?}: {torque}, expected {expected}");
    }

    #[test]
    fn a_button_starts_its_effects_and_again_while_it_is_held(button in 1..=16_u8, other in 1..=16_u8, repeat in 1..500_u16, duration in 1..400_u16) {
        let effect = Common { repeat, duration, button, delay: 0, ..common(Kind::Constant, duration) };
        let mut pool = Pool::new();
        pool.take(&Report::Create(Kind::Constant), 0);
        pool.take(&Report::Effect { block: 0, common: effect }, 0);
        pool.take(&Report::Constant { block: 0, magnitude: FULL }, 0);
        let mask = |button: u8| 1_u16 << (button - 1);
        let mut plays = |pressed: u16, ms: u64| {
            pool.press(pressed, 1000 * ms);
            torque(&mut pool, ms).is_some()
        };
        prop_assert!(!plays(0, 0));
        prop_assert_eq!(plays(mask(other), 1), other == button);
        prop_assert!(!plays(0, 2000));
        for ms in 0..1500 {
            // Started when pressed, and every `repeat` ms from then on.
            let since = ms % u64::from(repeat);
            prop_assert_eq!(plays(mask(button), 3000 + ms), since < u64::from(duration), "{} ms after the start", ms);
        }
    }
}

#[test]
fn a_full_pool_is_reported_and_a_freed_place_is_used_again() {
    let mut pool = Pool::new();
    for block in 0..EFFECTS {
        assert!(pool.take(&Report::Create(Kind::Spring), 0));
        assert_eq!(pool.feature(id::LOAD).unwrap()[1..4], [block as u8 + 1, 1, (EFFECTS - 1 - block) as u8]);
    }
    assert!(!pool.take(&Report::Create(Kind::Spring), 0));
    assert_eq!(pool.feature(id::LOAD).unwrap()[1..4], [0, 2, 0]);
    assert!(pool.take(&Report::Free { block: 5 }, 0) && !pool.take(&Report::Free { block: 5 }, 0));
    assert!(pool.take(&Report::Create(Kind::Damper), 0));
    assert_eq!(pool.feature(id::LOAD).unwrap()[1..4], [6, 1, 0]);
}

/// A free wheel with an initial velocity: the largest speeds of the first and of the last of four seconds.
fn speeds(device: &DeviceSpec, kick: f64, mut torque: impl FnMut(f64, f64) -> f64) -> [f64; 2] {
    let mut wheel = VirtualDevice::new(device);
    wheel.set_out((0.0, kick), (0.0, 0.0));
    let samples = (4.0 / device.period) as usize;
    let mut fastest = [0.0_f64; 2];
    let mut last = 0.0;
    for k in 0..samples {
        let (position, velocity) = wheel.puck();
        if k < samples / 4 {
            fastest[0] = fastest[0].max(velocity.abs());
        } else if k >= 3 * samples / 4 {
            fastest[1] = fastest[1].max(velocity.abs());
        }
        wheel.command(torque(position, position - last));
        last = position;
        wheel.travel();
    }
    fastest
}

proptest! {
    #![proptest_config(hapt_testing::cases(64))]

    /// Conditions of any size, without a dead band or an offset, on wheels with counts, with and without friction, for any initial velocity.
    #[test]
    fn hands_off_no_set_of_conditions_of_a_host_grows(
        conditions in proptest::collection::vec((0..4_usize, 0..=FULL, 0..=FULL), 1..8),
        inertia in 1e-3..0.1_f64, damping in 1e-3..0.1_f64, late in 0.0..1.0_f64, period in 2.5e-4..2e-3_f64,
        friction in prop_oneof![Just(0.0), 1e-3..0.1_f64], counts in 500.0..100_000.0_f64, kick in 0.2..4.0_f64,
    ) {
        let spec = DeviceSpec { delay: late * period, damping, friction, ..DeviceSpec::new(period, inertia) };
        let count = std::f64::consts::TAU / counts.round();
        let timing = Timing { delay: late * period, ..Timing::even(period) };
        let device = Device { friction, count, ..Device::ideal(timing, damping, 5.0) };
        let wheel = Wheel::<f32>::new(&device).unwrap();
        let mut pool = Pool::new();
        for (block, (kind, positive, negative)) in conditions.into_iter().enumerate() {
            pool.take(&Report::Create([Kind::Spring, Kind::Damper, Kind::Inertia, Kind::Friction][kind]), 0);
            let condition = Condition { positive, negative, positive_saturation: FULL, negative_saturation: FULL, ..Condition::default() };
            pool.take(&Report::Condition { block, axis: 0, condition }, 0);
            pool.take(&Report::Operation { block, operation: Operation::Start, loops: 255 }, 0);
        }
        let (mut state, mut now) = (wheel.start(), 0.0);
        let [first, last] = speeds(&spec, kick, |position, _| {
            now += 1e6 * period;
            let position = (position / count + 0.5).floor() * count;
            let (effects, count) = pool.effects(now as u64, &SCALE);
            f64::from(wheel.step(&mut state, position as f32, &effects[..count], pool.revision()).torque)
        });
        prop_assert!(first <= kick * (1.0 + 1e-3) && last <= first, "{first} rad/s at first, {last} rad/s in the end");
    }
}

#[test]
fn the_same_damper_and_inertia_from_differences_shake_the_wheel_hands_off() {
    let spec = DeviceSpec { delay: 5e-4, damping: 0.01, ..DeviceSpec::new(1e-3, 5e-3) };
    let damper = speeds(&spec, 2.0, |_, travel| (-20.0 * travel / 1e-3).clamp(-5.0, 5.0));
    // A limit cycle: without effects less than 2 exp(-2 · 3) rad/s would be left.
    assert!(damper[1] > 0.2, "{damper:?}");
    let mut before = 0.0;
    let inertia = speeds(&spec, 2.0, |_, travel| {
        let acceleration = (travel - before) / 1e-6;
        before = travel;
        (-0.02 * acceleration).clamp(-5.0, 5.0)
    });
    assert!(inertia[1] > 0.2, "{inertia:?}");
}
