//! Keys of the world that the certificate does not cover: a world with one of them is not certified, whatever else is found.

use hapt_model::{Device, Tolerances, World};

/// Why the certificate does not speak for this world; `None` where it does.
pub(super) fn uncovered(world: &World) -> Option<String> {
    let Device { lag, tolerances, .. } = &world.device;
    let Tolerances { inertia, damping, friction, lag: of_lag } = *tolerances;
    let keys = [
        ("loop.interval_max", world.sampling.interval_max_s() > world.sampling.period),
        ("loop.delay_max", world.sampling.delay_max_s() > world.sampling.delay_s()),
        ("device.lag", *lag > 0.0),
        ("the tolerances in [device]", [inertia, damping, friction, of_lag].iter().any(|tolerance| *tolerance > 0.0)),
    ];
    let given: Vec<&str> = keys.into_iter().filter(|(_, given)| *given).map(|(key, _)| key).collect();
    let listed = match given.as_slice() {
        [] => return None,
        [only] => only.to_string(),
        [others @ .., last] => format!("{} and {last}", others.join(", ")),
    };
    Some(format!("the certificate does not cover {listed} yet"))
}
