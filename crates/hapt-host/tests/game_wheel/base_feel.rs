//! The base feel of a wheel, without a game and together with effects: the couplings of its world, on an exact device without a hand.

use std::sync::{Arc, Mutex};

use hapt_core::wheel::Wheel;
use hapt_core::{Phase, Request, SafetyProfile};
use hapt_host::game_wheel::Room;
use hapt_model::{Source, World};
use hapt_plant::VirtualDevice;
use hapt_rt::{Cycle, Device, Failure, Moment, Outside, Plan, Position, effects};
use hapt_testing::prelude::*;
use hapt_wire::pid::{Condition, FULL, Kind, Operation, Pool, Report};

use crate::{LIMIT, RANGE};

const PERIOD: f64 = 1e-3;
const INERTIA: f64 = 0.02;
const DAMPING: f64 = 0.05;

/// A device that the test can set in motion.
#[derive(Clone)]
pub struct Free(pub Arc<Mutex<VirtualDevice>>);

impl Device for Free {
    fn read(&mut self) -> Result<Position, Failure> {
        let (position, velocity) = self.0.lock().unwrap().puck();
        Ok(Position { position, velocity, announced: false })
    }

    fn write(&mut self, torque: f64) -> Result<(), Failure> {
        self.0.lock().unwrap().command(torque);
        Ok(())
    }

    fn passed(&mut self, periods: u32) {
        (0..periods).for_each(|_| self.0.lock().unwrap().travel());
    }
}

fn damper(damping: f64) -> String {
    format!("[[couplings]]\nkind = \"damper\"\nbetween = [\"puck\", \"ground\"]\ndamping = {damping}\n")
}

fn friction(torque: f64, bristles: f64) -> String {
    format!(
        "[[couplings]]\nkind = \"friction\"\nbetween = [\"puck\", \"ground\"]\ncoulomb = {torque}\nstribeck = {torque}\n\
         stribeck_velocity = 0.1\nbristle_stiffness = {bristles}\nbristle_damping = 0\nviscous = 0\n"
    )
}

fn stop(side: &str, at: f64, stiffness: f64) -> String {
    format!(
        "[[couplings]]\nkind = \"wall\"\nbetween = [\"puck\", \"ground\"]\nside = \"{side}\"\nat = {at}\nstiffness = {stiffness}\n"
    )
}

/// A light body on a spring to the puck, damped to ground: more damping than a damper at the puck may have.
fn damped_body(stiffness: f64, damping: f64) -> String {
    format!(
        "[bodies.slider]\ninertia = 1e-4\n[[couplings]]\nkind = \"spring\"\nbetween = [\"puck\", \"slider\"]\nstiffness = {stiffness}\n\
         [[couplings]]\nkind = \"damper\"\nbetween = [\"slider\", \"ground\"]\ndamping = {damping}\n"
    )
}

/// Position and velocity of the wheel, sample by sample, from an initial velocity of `speed`, while these effects play.
fn course(delay: f64, couplings: &str, playing: &[(Kind, Report)], speed: f64, seconds: f64) -> Vec<(f64, f64)> {
    let text = format!(
        "loop = {{ period = {PERIOD}, delay = {delay}, estimator = \"difference\" }}\n\
         device = {{ inertia = {INERTIA}, damping = {DAMPING}, limit = {LIMIT} }}\n{couplings}"
    );
    let world = World::read(&Source::from_text("wheel.toml", text), &[]).unwrap();
    let room = Room::of(&world, RANGE).unwrap();
    let (port, mut wire) = effects(Wheel::new(room.device()).unwrap(), room.scale());
    let free = Free(Arc::new(Mutex::new(VirtualDevice::new(&world.device_spec()))));
    let plan = Plan::new(&world, SafetyProfile::Simulated).unwrap();
    let mut cycle = Cycle::new(Box::new(plan), Box::new(free.clone())).with_outside(Outside::playing(port));
    let mut samples = 0;
    let mut sample = |request| {
        let periods = u32::from(samples > 0);
        cycle.pass(periods);
        samples += 1;
        let now = samples * 1_000_000;
        (cycle.sample(&Moment { periods, now, ..Moment::default() }, request).unwrap().phase, now / 1000)
    };
    sample(None);
    let mut ready = sample(Some(Request::Arm));
    while ready.0 != Phase::Running {
        ready = sample(None);
    }
    let mut pool = Pool::new();
    for (block, (kind, report)) in playing.iter().enumerate() {
        for report in
            [Report::Create(*kind), *report, Report::Operation { block, operation: Operation::Start, loops: 1 }]
        {
            assert!(pool.take(&report, ready.1), "{report:?}");
        }
    }
    assert!(wire.pools.push(pool).is_ok());
    free.0.lock().unwrap().set_out((0.0, speed), (0.0, 0.0));
    let one = |_| {
        assert_eq!(sample(None).0, Phase::Running);
        free.0.lock().unwrap().puck()
    };
    (0..(seconds / PERIOD) as usize).map(one).collect()
}

#[test]
fn a_damper_of_the_world_slows_a_free_wheel_down_as_its_damping_and_the_devices_do() {
    for damping in [0.005, 0.02] {
        let course = course(0.0, &damper(damping), &[], 4.0, 0.5);
        for (k, (_, speed)) in course.iter().enumerate().skip(1) {
            let expected = 4.0 * (-(DAMPING + damping) / INERTIA * PERIOD * k as f64).exp();
            assert!((speed / expected - 1.0).abs() < 0.01, "{speed} rad/s after {k} ms, expected {expected}");
        }
    }
}

#[test]
fn a_friction_of_the_world_stops_a_free_wheel_where_its_work_is_the_kicks_energy_and_holds_a_games_small_torque() {
    let (torque, bristles) = (0.2, 40.0);
    let at = |playing: &[(Kind, Report)], speed: f64| {
        let course = course(0.0, &friction(torque, bristles), playing, speed, 2.0);
        let (position, end) = course[course.len() - 1];
        // It oscillates on its bristles at first.
        assert!(end.abs() < 0.01, "{end} rad/s");
        position
    };
    for speed in [2.0, 6.0_f64] {
        // J v' = -b v - C: v²J/2C without damping.
        let scale = DAMPING * speed / torque;
        let travel = INERTIA / DAMPING * (speed - torque / DAMPING * scale.ln_1p());
        // The bristles give way at first, and spring back at the end.
        let (found, slack) = (at(&[], speed), torque / bristles);
        assert!((found - travel).abs() < 0.01 * travel + slack, "{found} rad, expected {travel}");
    }
    // Without the friction a fourth of its torque would turn the wheel by more than a radian.
    let magnitude = FULL / 100;
    let found = at(&[(Kind::Constant, Report::Constant { block: 0, magnitude })], 0.0);
    assert!(found.abs() < 2.0 * torque / bristles, "{found} rad");
}

proptest! {
    #![proptest_config(hapt_testing::cases(64))]

    /// The world's own couplings use their part of the device's damping, and all conditions together the rest.
    #[test]
    fn hands_off_no_set_of_conditions_with_a_base_feel_grows(
        damping in 0.0..0.02_f64, body in proptest::option::of((0.1..5.0_f64, 0.01..0.3_f64)), torque in 1e-3..1.0_f64, bristles in 0.1..5.0_f64, stops in 0.5..5.0_f64, late in 0.0..0.5_f64,
        playing in proptest::collection::vec((0..4_usize, 0..=FULL, 0..=FULL), 1..8), kick in 0.2..4.0_f64,
    ) {
        let body = body.map_or(String::new(), |(stiffness, damping)| damped_body(stiffness, damping));
        let world = body + &damper(damping) + &friction(torque, bristles) + &stop("above", 0.3, stops) + &stop("below", -0.3, stops);
        let conditions = playing.into_iter().enumerate().map(|(block, (kind, positive, negative))| {
            let condition = Condition { positive, negative, positive_saturation: FULL, negative_saturation: FULL, ..Condition::default() };
            ([Kind::Spring, Kind::Damper, Kind::Inertia, Kind::Friction][kind], Report::Condition { block, axis: 0, condition })
        });
        let course = course(late * PERIOD, &world, &conditions.collect::<Vec<_>>(), kick, 4.0);
        let fastest = |course: &[(f64, f64)]| course.iter().map(|(_, speed)| speed.abs()).fold(0.0, f64::max);
        let (first, last) = course.split_at(course.len() / 2);
        let [first, last] = [first, last].map(fastest);
        prop_assert!(first <= kick * (1.0 + 1e-3) && last <= first, "{first} rad/s at first, {last} rad/s in the end");
    }
}
