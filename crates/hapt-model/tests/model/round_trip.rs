//! Writing a world and reading it back, over random worlds; and reading arbitrary text.

use std::path::Path;

use hapt_core::WhenLate;
use hapt_core::spec::Range;
use hapt_model::keys::PHYSICAL;
use hapt_model::{
    Body, Cogging, Compensated, Compensation, Coupling, Damping, Delay, Device, DeviceTorque, Drive, End,
    EstimatorKind, FrictionByPosition, Gravity, Hand, Handle, Law, Method, Motion, Mounting, Output, Safety, Sampling,
    Scenario, Shape, Source, Stops, Stribeck, Switching, Timing, Tolerances, Waveform, World,
};
use hapt_testing::laws::{laws, some_limited};
use hapt_testing::prelude::*;
use proptest::collection::vec;
use proptest::option;
use proptest::sample::{select, subsequence};

/// Any finite number, from all decades.
fn any_number() -> impl Strategy<Value = f64> {
    prop_oneof![Just(0.0), -10.0..10.0, any::<f64>().prop_filter("finite", |value| value.is_finite())]
}

/// 0, or a physical number: numbers of all decades brought nearer to 1.
fn zero_or_more() -> impl Strategy<Value = f64> {
    let nearer = |value: f64| if value == 0.0 || PHYSICAL.contains(&value) { value } else { value.powf(1.0 / 11.0) };
    any_number().prop_map(move |value| nearer(value.abs()))
}

fn positive() -> impl Strategy<Value = f64> {
    zero_or_more().prop_map(|value| if value == 0.0 { 0.1 } else { value })
}

/// A law, and a limit where it takes one.
fn law() -> impl Strategy<Value = (Law, Option<f64>)> {
    let number = |_: &str, range: Range| match range {
        Range::Any => any_number().boxed(),
        Range::ZeroOrMore => zero_or_more().boxed(),
        Range::Positive => positive().boxed(),
    };
    some_limited(laws(|law| !law.is_compensating(), number), positive())
}

/// A coupling, and for some springs the damper that compensates it. Where `linear_at_bodies`, a nonlinear one becomes a spring.
fn couplings(bodies: usize, linear_at_bodies: bool) -> impl Strategy<Value = Vec<Coupling>> {
    let ends: Vec<End> = [End::Puck, End::Ground].into_iter().chain((0..bodies).map(End::Body)).collect();
    let pair = select(ends.clone()).prop_flat_map(move |first| {
        let others: Vec<End> = ends.iter().copied().filter(|&end| end != first).collect();
        (Just(first), select(others))
    });
    let one = (pair, law(), any::<bool>()).prop_map(move |((first, second), (law, limit), compensated)| {
        let at_body = matches!(first, End::Body(_)) || matches!(second, End::Body(_));
        let mut coupling = Coupling { first, second, law, limit };
        if law.is_at_puck() {
            (coupling.first, coupling.second) = (End::Ground, End::Puck);
        }
        if linear_at_bodies && at_body && !law.is_at_puck() && (coupling.linear().is_none() || law.constant().is_some())
        {
            coupling = Law::Spring { stiffness: 1.0, rest: 0.5 }.between(first, second);
        }
        let law = coupling.law;
        let mut couplings = vec![coupling];
        if compensated && matches!(law, Law::Spring { .. }) {
            let law = Law::Damper { damping: Damping::Compensating };
            couplings.push(Coupling { first: second, second: first, law, limit: None });
        }
        couplings
    });
    vec(one, 0..6).prop_map(|couplings| couplings.concat())
}

fn shape(file: &'static str, points: Vec<(f64, f64)>) -> impl Strategy<Value = Shape> {
    prop_oneof![
        (any_number(), zero_or_more()).prop_map(|(to, at)| Shape::Step { to, at }),
        (any_number(), zero_or_more(), positive()).prop_map(|(to, at, over)| Shape::Ramp { to, at, over }),
        (any_number(), positive(), any_number()).prop_map(|(amplitude, frequency, phase)| Shape::Sine {
            amplitude,
            frequency,
            phase
        }),
        Just(Shape::Path { file: file.to_string(), points }),
    ]
}

const POINTS: [(f64, f64); 2] = [(0.0, 0.1), (1.5, -2e-7)];

fn hand() -> impl Strategy<Value = Hand> {
    let position = || shape("puck \"1\".csv", POINTS.to_vec());
    let drive = prop_oneof![
        position().prop_map(Drive::Position),
        shape("torque.csv", POINTS.to_vec()).prop_map(Drive::Torque),
        (zero_or_more(), zero_or_more(), zero_or_more(), position(), option::of((1e-3..1e3, 1e-3..1e3))).prop_map(
            |(inertia, damping, stiffness, moves, switching)| {
                let switching = switching.map(|(hold, open)| Switching { hold, open });
                Drive::Grip { inertia, damping, stiffness, moves, switching }
            }
        ),
    ];
    (drive, option::of(zero_or_more())).prop_map(|(drive, release)| Hand { drive, release })
}

fn sampling() -> impl Strategy<Value = Sampling> {
    let choices = (select(Method::ALL.to_vec()), select(Output::ALL.to_vec()), select(EstimatorKind::ALL.to_vec()));
    // Steps ahead, or samples from one step of the bodies to the next.
    let steps = (0u32..=1000, prop_oneof![Just(1), 1u32..=1000]);
    (
        1e-6..1.0,
        choices,
        steps,
        (0.0..1e5, any::<bool>()),
        uneven(),
        (option::of(positive()), option::of(positive()), option::of(2.0..1e3)),
        (1u32..=256, 1u32..=256),
    )
        .prop_map(
            |(
                period,
                (method, output, estimator),
                (advance, bodies_every),
                (delays, follows),
                (longer, later),
                (cutoff, filter, recentre),
                (every, window),
            )| {
                let output = if method.takes_new_sample_first() { Output::Start } else { output };
                let advance = if output == Output::End && bodies_every == 1 { advance } else { 0 };
                let bodies_every = if method.takes_new_sample_first() { 1 } else { bodies_every };
                let filters = matches!(estimator, EstimatorKind::LowPass | EstimatorKind::Kalman);
                let cutoff = if filters { cutoff.or(Some(50.0)) } else { cutoff };
                let acceleration = (estimator == EstimatorKind::Levant).then_some(cutoff.unwrap_or(1e3));
                let delay = if follows { Delay::Samples(delays) } else { Delay::Seconds(delays * period) };
                let interval_max = longer.map(|longer| longer * period);
                let delay_max = later.map(|(later, follows)| {
                    let samples = delay.seconds(period) / period * later;
                    if follows { Delay::Samples(samples) } else { Delay::Seconds(samples * period) }
                });
                // Rounding may leave the largest delay below the least.
                let delay_max = delay_max.filter(|largest| largest.seconds(period) >= delay.seconds(period));
                Sampling {
                    period,
                    method,
                    output,
                    advance,
                    bodies_every,
                    interval_max,
                    delay,
                    delay_max,
                    filter,
                    recentre: recentre.map(|periods: f64| periods * period),
                    estimator,
                    cutoff,
                    acceleration,
                    every,
                    window,
                }
            },
        )
}

/// The longest interval in periods, and the largest delay in least ones and whether it follows the period.
fn uneven() -> impl Strategy<Value = (Option<f64>, Option<(f64, bool)>)> {
    (option::of(1.0..10.0), option::of((1.0..8.0, any::<bool>())))
}

/// A timing that suits the loop.
fn timing(sampling: &Sampling) -> impl Strategy<Value = Timing> + use<> {
    let (longest, delay) = (sampling.interval_max_s() / sampling.period, sampling.delay_s() / sampling.period);
    let (period, late) = (sampling.period, sampling.delay_max_s() > sampling.period);
    (0..5, any::<u32>(), vec(0.1f64..1.0, 1..5), option::of(0.5f64..1.0)).prop_map(
        move |(kind, seed, parts, shortest)| {
            let intervals: Vec<f64> =
                parts.iter().map(|part| delay.max(0.1) + (longest - delay.max(0.1)) * part).collect();
            match kind {
                _ if late => Timing::Even,
                0 => Timing::Even,
                1 => Timing::Random { seed, shortest: shortest.map(|part| part * period) },
                2 => Timing::Pattern { intervals, delays: vec![] },
                3 => Timing::Worst,
                _ => Timing::Pattern { delays: vec![delay; intervals.len()], intervals },
            }
        },
    )
}

fn tolerances() -> impl Strategy<Value = Tolerances> {
    let some = || prop_oneof![Just(0.0), Just(0.2), 1e-9..1.0];
    let all = || prop_oneof![Just(1.0), some()];
    (some(), all(), all(), all(), all()).prop_map(|(inertia, damping, friction, friction_backward, lag)| Tolerances {
        inertia,
        damping,
        friction,
        friction_backward,
        lag,
    })
}

fn device(motion: Motion) -> impl Strategy<Value = Device> {
    let encoder = match motion {
        Motion::Rotary => (1u64..=1 << 53).prop_map(|counts| counts as f64).boxed(),
        Motion::Linear => positive().boxed(),
    };
    let motor = option::of((positive(), option::of(1u32..1 << 31)));
    let drive = (option::of(positive()), any::<bool>(), option::of(any_number()));
    let drive = drive.prop_map(|(gear, reversed, home)| Mounting { gear, reversed, home });
    let handle = (positive(), positive(), zero_or_more());
    let handle = handle.prop_map(|(inertia, stiffness, damping)| Handle { inertia, stiffness, damping });
    let lag = (zero_or_more(), tolerances());
    let gravity = option::of((zero_or_more(), any_number()).prop_map(|(torque, phase)| Gravity { torque, phase }));
    let gravity = if motion == Motion::Rotary { gravity.boxed() } else { Just(None).boxed() };
    let factors = || prop::array::uniform4(-1.0_f32..1.0);
    let cogging = (zero_or_more(), positive(), any_number(), factors(), factors());
    let cogging = option::of(cogging.prop_map(|(torque, pitch, phase, sine, cosine)| Cogging {
        torque,
        pitch,
        phase,
        waveform: Waveform { sine, cosine },
    }));
    let changes =
        (0.0..1.0, positive(), any_number(), factors(), factors()).prop_map(|(most, pitch, phase, sine, cosine)| {
            let whole = FrictionByPosition { share: 1.0, pitch, phase, waveform: Waveform { sine, cosine } };
            FrictionByPosition { share: if whole.most() > 0.0 { most / whole.most() } else { most }, ..whole }
        });
    let torque = (gravity, cogging).prop_map(|(gravity, cogging)| DeviceTorque { gravity, cogging });
    let stribeck = (zero_or_more(), positive()).prop_map(|(torque, velocity)| Stribeck { torque, velocity });
    let stops = (option::of(zero_or_more()), zero_or_more(), any::<bool>(), positive(), zero_or_more()).prop_map(
        |(one, other, turned, stiffness, damping)| {
            let (low, high) = if turned { (Some(-other), one) } else { (one.map(|at| -at), Some(other)) };
            Stops { low, high, stiffness, damping }
        },
    );
    let outside = (drive, option::of(stribeck), option::of(stops), option::of(handle), torque);
    let friction = (zero_or_more(), option::of(zero_or_more()), option::of(changes));
    (positive(), zero_or_more(), friction, lag, option::of(encoder), motor, outside).prop_map(
        |(
            inertia,
            damping,
            (friction, backward, friction_by_position),
            (lag, tolerances),
            encoder,
            motor,
            (drive, stribeck, stops, handle, torque),
        )| Device {
            inertia,
            damping,
            friction,
            friction_backward: backward,
            friction_by_position,
            lag,
            // An absent key has no tolerance.
            tolerances: Tolerances {
                friction_backward: if backward.is_some() { tolerances.friction_backward } else { 0.0 },
                ..tolerances
            },
            limit: motor.map(|(limit, _)| limit),
            encoder,
            levels: motor.and_then(|(_, half)| half).map(|half| half * 2),
            drive,
            stribeck,
            stops,
            handle,
            torque,
        },
    )
}

fn safety() -> impl Strategy<Value = Safety> {
    let some = || option::of(positive());
    let first = (positive(), some(), some(), some(), option::of(zero_or_more()), some(), some());
    let second = (some(), positive(), some(), positive(), option::of(zero_or_more()), option::of(zero_or_more()));
    let third = (
        any::<bool>(),
        some(),
        option::of(any::<bool>()),
        option::of(zero_or_more()),
        zero_or_more(),
        option::of(select(WhenLate::ALL.to_vec())),
    );
    (first, second, third).prop_map(|(first, second, third)| {
        let (fade, velocity, jump, overspeed, stuck, torque, slew) = first;
        let (rms, heating, driver_rms, driver_heating, stall, link) = second;
        let (link_faults, energy, world_trips, pulse, brake, late) = third;
        Safety {
            fade,
            velocity,
            jump,
            overspeed,
            stuck,
            torque,
            slew,
            rms,
            heating,
            driver_rms,
            driver_heating,
            stall,
            late,
            link,
            link_faults,
            energy,
            world_trips,
            pulse,
            brake,
        }
    })
}

fn compensations() -> impl Strategy<Value = Vec<Compensation>> {
    let one = |(of, share, velocity): (Compensated, f64, f64)| {
        let velocity_of = (of == Compensated::Friction).then_some(velocity);
        let cutoff = (of == Compensated::Inertia).then_some(10.0 * velocity);
        Compensation { of, share, velocity: velocity_of, cutoff }
    };
    subsequence(Compensated::ALL.to_vec(), 0..=Compensated::ALL.len())
        .prop_shuffle()
        .prop_flat_map(|all| all.into_iter().map(|of| (Just(of), 0.0..=1.0, positive())).collect::<Vec<_>>())
        .prop_map(move |all| all.into_iter().map(one).collect())
}

fn world() -> impl Strategy<Value = World> {
    let body = (positive(), any_number(), any_number()).prop_map(|(inertia, position, velocity)| Body {
        inertia,
        position,
        velocity,
    });
    let title = option::of("(\\PC|[\n\t\"\\\\\u{1}\u{7f}]){0,12}");
    (select(vec![Motion::Rotary, Motion::Linear]), sampling(), vec(body, 0..4), title)
        .prop_flat_map(|(motion, sampling, bodies, title)| {
            let bodies_every = if bodies.is_empty() { 1 } else { sampling.bodies_every };
            let sampling = Sampling { bodies_every, ..sampling };
            let couplings = couplings(bodies.len(), !sampling.method.is_explicit() || bodies_every > 1);
            let scenarios = vec((0.0..1e9, hand(), timing(&sampling)), 0..4);
            // Boxed: the frames of all parts together overflow the stack of a test without optimisation.
            (
                Just((motion, sampling, bodies, title)),
                (device(motion).boxed(), safety().boxed()),
                (couplings.boxed(), compensations()),
                scenarios.boxed(),
            )
        })
        .prop_map(|((motion, sampling, bodies, title), (device, safety), (couplings, compensations), scenarios)| {
            let names = ["z-w", "A_1", "x", "y"].map(String::from).into_iter().take(bodies.len()).collect();
            let scenario = |(index, (samples, hand, timing)): (usize, (f64, Hand, Timing))| Scenario {
                name: format!("{index}-s"),
                duration: (samples + 1.0) * sampling.period,
                hand,
                timing,
            };
            let scenarios = scenarios.into_iter().enumerate().map(scenario).collect();
            let mut device = device;
            // With friction a shaft may oscillate by 100 rad in a period.
            let swing = |shaft: Handle| (shaft.stiffness * (device.inertia.recip() + shaft.inertia.recip())).sqrt();
            if device.handle.is_some_and(|shaft| swing(shaft) * sampling.period > 99.0) {
                (device.stribeck, device.friction, device.friction_backward) =
                    (None, 0.0, device.friction_backward.map(|_| 0.0));
            }
            // The same holds with gravity, cogging, Stribeck friction and stops, with which a hand may be too fast too.
            if device.fault(sampling.period).is_some() {
                (device.torque, device.friction_by_position) = (DeviceTorque::default(), None);
                (device.stribeck, device.stops) = (None, None);
            }
            // An origin that slips needs friction of the device, and no coupling at the puck that it would follow.
            let carries = |law: &Law| {
                matches!(law, Law::Constant { .. } | Law::Integral { .. } | Law::Assist { .. } | Law::Coulomb { .. })
            };
            let recentre = sampling
                .recentre
                .filter(|_| device.least_friction() > 0.0 && !couplings.iter().any(|coupling| carries(&coupling.law)));
            let sampling = Sampling { recentre, ..sampling };
            let mut sampling = sampling;
            if couplings.iter().any(|coupling| coupling.law.is_at_puck()) {
                sampling.advance = 0;
            }
            // The motor's limit is that of the pulse too.
            let pulse = safety.pulse.map(|pulse| device.limit.map_or(pulse, |limit| pulse.min(limit)));
            let safety = Safety { pulse, ..safety };
            // The velocity of friction's compensation is that at the sample, and the origin of a compensation stays.
            let is_possible = |one: &Compensation| {
                let is_there =
                    one.of != Compensated::Friction || (device.least_friction() > 0.0 && sampling.advance == 0);
                is_there && sampling.recentre.is_none() && device.compensation(*one).is_some()
            };
            // A low-pass of samples has a cutoff below their rate.
            let slow = |cutoff: f64| cutoff.min(0.5 / sampling.period);
            let mut couplings = couplings;
            for coupling in &mut couplings {
                if let Law::Acceleration { cutoff, .. } = &mut coupling.law {
                    *cutoff = slow(*cutoff);
                }
            }
            let slowed = |one: Compensation| Compensation { cutoff: one.cutoff.map(slow), ..one };
            let compensations: Vec<Compensation> = compensations.into_iter().map(slowed).filter(is_possible).collect();
            let compensating = compensations.iter().filter_map(|one| device.compensation(*one));
            let couplings = couplings.into_iter().chain(compensating).collect();
            World { title, motion, sampling, device, safety, names, bodies, couplings, compensations, scenarios }
        })
}

fn read_in(folder: &Path, text: &str) -> Result<World, String> {
    let source = Source { folder: folder.to_path_buf(), ..Source::from_text("w.toml", text) };
    World::read(&source, &[]).map_err(|error| format!("{error}\n{text}"))
}

#[test]
fn a_world_reads_back_from_the_file_it_writes() {
    let folder = tempfile::tempdir().unwrap();
    let mut runner = proptest::test_runner::TestRunner::new(hapt_testing::cases(400));
    let points: String = POINTS.iter().map(|(time, value)| format!("{time:?},{value:?}\n")).collect();
    let csv =
        |file: &str, header: &str| std::fs::write(folder.path().join(file), format!("{header}\n{points}")).unwrap();
    let outcome = runner.run(&world(), |world| {
        let (puck, torque) = match world.motion {
            Motion::Rotary => ("time_s,puck_rad", "time_s,torque_Nm"),
            Motion::Linear => ("time_s,puck_m", "time_s,force_N"),
        };
        csv("puck \"1\".csv", puck);
        csv("torque.csv", torque);
        let text = world.to_toml();
        let found = read_in(folder.path(), &text);
        // A hand that turns the puck thousands of times in a sample with friction is refused.
        prop_assume!(!matches!(&found, Err(error) if error.contains("the longest interval, and beside device.")));
        prop_assert_eq!(found, Ok(world));
        Ok(())
    });
    outcome.unwrap_or_else(|error| panic!("{error}"));
}

#[test]
fn a_written_world_has_units_and_no_noise() {
    let text = "loop.period = \"1 ms\"\ndevice.inertia = \"6.4e-4 kg m^2\"\n";
    assert_eq!(
        World::read(&Source::from_text("w", text), &[]).unwrap().to_toml(),
        "motion = \"rotary\"\n\n[loop]\nmethod = \"zoh\"\noutput = \"end\"\nestimator = \"exact\"\n\
         period = \"0.001 s\"\nadvance = 0\nbodies_every = 1\ndelay = \"0.0 s\"\nevery = 1\nwindow = 16\n\n[device]\ninertia = \"0.00064 kg m^2\"\ndamping = \"0.0 N m s/rad\"\n\
         friction = \"0.0 N m\"\nlag = \"0.0 s\"\n"
    );
}

/// Lines with a valid beginning, so that random ones get far.
fn line() -> impl Strategy<Value = String> {
    let words = "motion|loop|device|bodies|couplings|scenarios|kind|between|hand|moves|w|s|period|inertia|duration|to|stiffness";
    let key = || proptest::string::string_regex(&format!("({words})(\\.({words})){{0,3}}")).unwrap();
    let value = "(\"1 ms\"|\"1 kg m\\^2\"|1|-1|1e400|nan|true|\"spring\"|\"step\"|\"torque\"|\"linear\"|\\[\"puck\", \"w\"\\]|\\{ kind = \"step\", to = 1 \\}|\\[\\]|\\{\\}|\\[\\{\\}\\])";
    prop_oneof![
        4 => (key(), value).prop_map(|(key, value)| format!("{key} = {value}")),
        1 => key().prop_map(|key| format!("[{key}]")),
        1 => key().prop_map(|key| format!("[[{key}]]")),
        1 => "\\PC{0,30}",
    ]
}

proptest! {
    #![proptest_config(hapt_testing::cases(1500))]

    #[test]
    fn no_text_panics(text in "[\\PC\n\t\r]{0,200}", set in "\\PC{0,40}") {
        let _ = World::read(&Source::from_text("w", text), &[set]).map_err(|error| error.to_string());
    }

    #[test]
    fn nothing_like_a_world_panics(lines in vec(line(), 0..12), sets in vec(line(), 0..3)) {
        let _ = World::read(&Source::from_text("w", lines.join("\n")), &sets).map_err(|error| error.to_string());
        let text = "loop.period = 1\ndevice.inertia = 1\nbodies.w.inertia = 1\n[[couplings]]\nkind = \"constant\"\n";
        let _ = World::read(&Source::from_text("w", text), &sets).map_err(|error| error.to_string());
    }

    #[test]
    fn a_damaged_world_does_not_panic(world in world(), cut in 0usize..2000, junk in "\\PC{0,3}") {
        let text = world.to_toml();
        let cut = (0..=cut.min(text.len())).rev().find(|&cut| text.is_char_boundary(cut)).unwrap_or(0);
        let (head, tail) = text.split_at(cut);
        let _ = World::read(&Source::from_text("w", format!("{head}{junk}{tail}")), &[]).map_err(|error| error.to_string());
        let _ = World::read(&Source::from_text("w", head), &[]).map_err(|error| error.to_string());
    }
}
