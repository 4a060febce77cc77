//! The loop of hapt-core: a spec, a state and measurements of any bits.

use hapt_core::{Body, Coupling, End, Error, Estimator, Law, Loop, Method, Output, Real, Spec, State, Vector};

use crate::messages::outcome;

/// A microcontroller's capacity, for both kinds of numbers.
const BODIES: usize = 4;
const COUPLINGS: usize = 8;
const COUNTS: usize = 17;

/// Numbers at edges of the code.
const NUMBERS: [f64; 24] = [
    0.0,
    1.0,
    -1.0,
    0.5,
    1e-3,
    2.0,
    -0.0,
    100.0,
    1e-6,
    0.02,
    f64::NAN,
    f64::INFINITY,
    f64::NEG_INFINITY,
    f64::MAX,
    f64::MIN,
    f64::MIN_POSITIVE,
    5e-324,
    1e300,
    1e-300,
    1e20,
    -1e20,
    1e-20,
    3.5e38,
    1e-46,
];

/// The input, taken bit by bit; zeros when it is used up.
struct Bits<'a>(&'a [u8]);

impl Bits<'_> {
    fn byte(&mut self) -> u8 {
        let (&first, rest) = self.0.split_first().unwrap_or((&0, &[]));
        self.0 = rest;
        first
    }

    fn word(&mut self) -> u64 {
        u64::from_le_bytes(std::array::from_fn(|_| self.byte()))
    }

    fn below(&mut self, n: usize) -> usize {
        usize::from(self.byte()) % n
    }

    /// One of the numbers above, a plain decimal, or any bits.
    fn number(&mut self) -> f64 {
        match self.byte() {
            tag @ 0..=63 => NUMBERS[usize::from(tag) % NUMBERS.len()],
            tag @ 64..=191 => f64::from(tag) * 1e-2,
            _ => f64::from_bits(self.word()),
        }
    }

    fn maybe(&mut self) -> Option<f64> {
        if self.byte() & 1 == 0 { None } else { Some(self.number()) }
    }

    fn end(&mut self) -> End {
        match self.below(11) {
            0 | 1 => End::Puck,
            2 => End::Ground,
            7 => End::Body(self.word() as usize),
            other => End::Body(other - 3),
        }
    }

    /// One in two of the laws that take a limit has one.
    fn limit(&mut self, law: Law) -> Option<f64> {
        (law.takes_limit() && self.byte() & 1 == 1).then(|| self.number())
    }

    fn law(&mut self) -> Law {
        let mut law = Law::ALL[self.below(Law::ALL.len())];
        for quantity in law.quantities() {
            *quantity.value = self.number();
        }
        if let Some(waveform) = law.waveform_mut() {
            waveform.sine = std::array::from_fn(|_| self.number() as f32);
            waveform.cosine = std::array::from_fn(|_| self.number() as f32);
        }
        law
    }

    fn vector<F: Real>(&mut self) -> Vector<F, BODIES> {
        Vector {
            position: std::array::from_fn(|_| F::from_f64(self.number())),
            velocity: std::array::from_fn(|_| F::from_f64(self.number())),
        }
    }
}

/// Every command is finite and within the limit, for any world, state and measurements; every sample ends.
pub fn run(bytes: &[u8]) -> u64 {
    let mut bits = Bits(bytes);
    let small = bits.byte() & 1 == 1;
    let bodies: Vec<Body> = (0..bits.below(BODIES + 2))
        .map(|_| Body { inertia: bits.number(), position: bits.number(), velocity: bits.number() })
        .collect();
    let couplings: Vec<Coupling> = (0..bits.below(COUPLINGS + 2))
        .map(|_| Coupling { first: bits.end(), second: bits.end(), law: bits.law(), limit: None })
        .collect();
    let couplings: Vec<Coupling> = couplings.into_iter().map(|c| Coupling { limit: bits.limit(c.law), ..c }).collect();
    let spec = Spec {
        period: bits.number(),
        method: Method::ALL[bits.below(Method::ALL.len())],
        output: Output::ALL[bits.below(Output::ALL.len())],
        advance: match bits.byte() {
            255 => bits.word() as u32,
            few => u32::from(few % 8),
        },
        bodies_every: match bits.byte() {
            255 => bits.word() as u32,
            few => 1 + u32::from(few % 4),
        },
        estimator: match bits.below(8) {
            0 => Estimator::Exact,
            1 => Estimator::Difference,
            2 => Estimator::LowPass { cutoff: bits.number() },
            3 => Estimator::Foaw { window: u32::from(bits.byte()) },
            4 => Estimator::FoawBest { window: u32::from(bits.byte()) },
            5 => Estimator::Kalman { cutoff: bits.number() },
            6 => Estimator::Levant { acceleration: bits.number() },
            _ => Estimator::DifferenceOver { every: u32::from(bits.byte()) },
        },
        filter: bits.maybe(),
        count: bits.maybe(),
        limit: bits.maybe(),
        levels: if bits.byte() & 1 == 0 { None } else { Some(bits.word() as u32) },
        bodies: &bodies,
        couplings: &couplings,
    };
    if small { drive::<f32>(&spec, &mut bits) } else { drive::<f64>(&spec, &mut bits) }
}

fn drive<F: Real>(spec: &Spec<'_>, bits: &mut Bits<'_>) -> u64 {
    let control = match Loop::<F, BODIES, COUPLINGS, COUNTS>::new(spec) {
        Ok(control) => control,
        Err(error) => return outcome(&words(&error)),
    };
    let limit = spec.limit.map(F::from_f64);
    let mut state = control.start();
    if bits.byte() & 1 == 1 {
        state = any_state(state, bits);
    }
    for _ in 0..20 {
        let sample = control.step(&mut state, F::from_f64(bits.number()), F::from_f64(bits.number()));
        assert!(sample.command.is_finite(), "commands {:?} in {spec:?}", sample.command);
        if let Some(limit) = limit {
            let within = sample.command <= limit && sample.command >= -limit;
            assert!(within, "commands {:?} beyond {limit:?} in {spec:?}", sample.command);
        }
    }
    outcome(&(spec.method as u8, spec.output as u8, spec.bodies.len(), spec.couplings.len(), spec.limit.is_some()))
}

/// A state of any bits, as after a fault of the memory or a replay of another world's.
fn any_state<F: Real>(
    start: State<F, BODIES, COUPLINGS, COUNTS>,
    bits: &mut Bits<'_>,
) -> State<F, BODIES, COUPLINGS, COUNTS> {
    let mut state = start;
    state.now = bits.vector();
    state.change = bits.vector();
    state.until_step = bits.word() as u32;
    state.bristles = std::array::from_fn(|_| F::from_f64(bits.number()));
    state.memory.counts = std::array::from_fn(|_| F::from_f64(bits.number()));
    if bits.byte() & 1 == 1 {
        let (position, velocity) = (F::from_f64(bits.number()), F::from_f64(bits.number()));
        state.memory.last = Some(hapt_core::Puck { position, velocity });
    }
    state.memory.newest = bits.word() as usize;
    state.memory.older = bits.word() as usize;
    state
}

fn words(error: &Error) -> String {
    error.to_string().chars().filter(|c| c.is_alphabetic()).collect()
}
