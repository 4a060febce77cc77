//! A puck under Coulomb friction in closed form: modes and particular solutions, with events by a fine search and bisection.
//!
//! ```text
//! M ẍ + B ẋ + K x = u(t) - friction · direction,    u = value + slope t + Im(S e^(iωt)) + gap e^(-t/lag)
//! ```

use std::ops::{Add, Mul};

#[derive(Clone, Copy, Debug, Default)]
pub struct Complex {
    pub re: f64,
    pub im: f64,
}

impl Complex {
    pub fn new(re: f64, im: f64) -> Self {
        Complex { re, im }
    }

    pub fn polar(size: f64, angle: f64) -> Self {
        Complex { re: size * angle.cos(), im: size * angle.sin() }
    }

    fn exp(self) -> Self {
        Complex::polar(self.re.exp(), self.im)
    }

    fn inverse(self) -> Self {
        let square = self.re * self.re + self.im * self.im;
        Complex { re: self.re / square, im: -self.im / square }
    }
}

impl Add for Complex {
    type Output = Self;
    fn add(self, b: Self) -> Self {
        Complex { re: self.re + b.re, im: self.im + b.im }
    }
}

impl Mul for Complex {
    type Output = Self;
    fn mul(self, b: Self) -> Self {
        Complex { re: self.re * b.re - self.im * b.im, im: self.re * b.im + self.im * b.re }
    }
}

impl Mul<Complex> for f64 {
    type Output = Complex;
    fn mul(self, b: Complex) -> Complex {
        Complex { re: self * b.re, im: self * b.im }
    }
}

/// The moving body: device and hand together.
#[derive(Clone, Copy, Debug)]
pub struct Body {
    pub mass: f64,
    pub damping: f64,
    pub stiffness: f64,
    /// Toward larger positions, and toward smaller ones.
    pub friction: [f64; 2],
}

impl Body {
    fn toward(&self, side: f64) -> f64 {
        self.friction[usize::from(side < 0.0)]
    }
}

/// The torque u(t).
#[derive(Clone, Copy, Debug, Default)]
pub struct Push {
    pub value: f64,
    pub slope: f64,
    pub sine: Complex,
    pub omega: f64,
    pub gap: f64,
    /// 1/lag; 0 without one.
    pub decay: f64,
}

impl Push {
    fn at(&self, t: f64) -> f64 {
        let turned = self.sine * Complex::polar(1.0, self.omega * t);
        self.value + self.slope * t + turned.im + self.gap * (-self.decay * t).exp()
    }

    fn size(&self, dt: f64) -> f64 {
        self.value.abs() + (self.slope * dt).abs() + self.sine.re.hypot(self.sine.im) + self.gap.abs()
    }

    /// The same from `t` on.
    pub fn later(&self, t: f64) -> Push {
        let gap = self.gap * (-self.decay * t).exp();
        let sine = self.sine * Complex::polar(1.0, self.omega * t);
        Push { value: self.value + self.slope * t, sine, gap, ..*self }
    }
}

/// x and v of a slide as a function of time.
struct Slide {
    body: Body,
    push: Push,
    /// Parts that belong to the modes: their rates, and x's and v's share of each.
    modes: [(Complex, Complex, Complex); 2],
    from: f64,
}

impl Slide {
    fn new(body: Body, push: Push, (x, v): (f64, f64)) -> Self {
        let Body { mass, damping, stiffness, .. } = body;
        let none = (Complex::default(), Complex::default(), Complex::default());
        let mut slide = Slide { body, push, modes: [none; 2], from: 0.0 };
        let (px, pv) = slide.particular(0.0);
        let (x, v) = (x - px, v - pv);
        if stiffness == 0.0 {
            let rate = Complex::new(-damping / mass, 0.0);
            slide.modes[0] = (rate, Complex::new(-v * mass / damping, 0.0), Complex::new(v, 0.0));
            slide.from = x + v * mass / damping;
            return slide;
        }
        let (half, square) = (damping / (2.0 * mass), stiffness / mass);
        let root = half * half - square;
        let rates = if root >= 0.0 {
            let fast = -half - root.sqrt();
            [Complex::new(fast, 0.0), Complex::new(square / fast, 0.0)]
        } else {
            [Complex::new(-half, (-root).sqrt()), Complex::new(-half, -(-root).sqrt())]
        };
        // x = C₁ + C₂, v = r₁ C₁ + r₂ C₂.
        let [one, two] = rates;
        let apart = (one + -1.0 * two).inverse();
        let parts = [(Complex::new(v, 0.0) + -x * two) * apart, -1.0 * (Complex::new(v, 0.0) + -x * one) * apart];
        for i in 0..2 {
            slide.modes[i] = (rates[i], parts[i], rates[i] * parts[i]);
        }
        slide
    }

    fn particular(&self, t: f64) -> (f64, f64) {
        let Body { mass, damping, stiffness, .. } = self.body;
        let Push { value, slope, sine, omega, gap, decay } = self.push;
        let turned = sine * Complex::polar(1.0, omega * t);
        let fading = gap * (-decay * t).exp();
        if stiffness == 0.0 {
            let tau = mass / damping;
            let mut x = value * t / damping + slope / damping * (0.5 * t * t - tau * t);
            let mut v = value / damping + slope / damping * (t - tau);
            if omega > 0.0 {
                let swing = turned * Complex::new(damping, omega * mass).inverse();
                (x, v) = (x + (swing * Complex::new(0.0, omega).inverse()).im, v + swing.im);
            }
            if decay > 0.0 {
                let part = fading / (damping - decay * mass);
                (x, v) = (x - part / decay, v + part);
            }
            return (x, v);
        }
        let swing = turned * Complex::new(stiffness - omega * omega * mass, omega * damping).inverse();
        let part = fading / (mass * decay * decay - damping * decay + stiffness);
        let x = (value + slope * (t - damping / stiffness)) / stiffness + swing.im + part;
        (x, slope / stiffness + (Complex::new(0.0, omega) * swing).im - decay * part)
    }

    fn at(&self, t: f64) -> (f64, f64) {
        let (mut x, mut v) = self.particular(t);
        for (rate, of_x, of_v) in self.modes {
            let grown = (t * rate).exp();
            (x, v) = (x + (of_x * grown).re, v + (of_v * grown).re);
        }
        (x + self.from, v)
    }

    /// The rounding error of v.
    fn noise(&self, dt: f64) -> f64 {
        let modes: f64 = self.modes.iter().map(|(_, _, v)| v.re.hypot(v.im)).sum();
        let Body { damping, stiffness, .. } = self.body;
        let steady = if stiffness == 0.0 { self.push.size(dt) / damping } else { self.particular(0.0).1.abs() };
        1e-14 * (modes + steady)
    }
}

/// Instants in (0, dt]: 2000 evenly, and denser ones at the start for the fastest rate.
fn instants(fastest: f64, dt: f64) -> Vec<f64> {
    let mut all: Vec<f64> = (1..=2000).map(|i| dt * f64::from(i) / 2000.0).collect();
    let mut t = 1e-4 / fastest;
    while t < dt {
        all.push(t);
        t *= 1.05;
    }
    all.sort_by(f64::total_cmp);
    all
}

/// The first of these instants at which g is above `noise`, and from there the last change of its sign before.
fn first_above(instants: &[f64], noise: f64, g: impl Fn(f64) -> f64) -> Option<f64> {
    let mut low = 0.0;
    for &t in instants {
        let value = g(t);
        if value > noise {
            let mut high = t;
            while high - low > 1e-15 * high {
                let middle = 0.5 * (low + high);
                if middle <= low || middle >= high {
                    break;
                }
                if g(middle) > 0.0 { high = middle } else { low = middle }
            }
            return Some(high);
        }
        if value <= 0.0 {
            low = t;
        }
    }
    None
}

/// Position and velocity after `dt`, and how many stops and starts there were.
pub fn advance(body: Body, mut push: Push, (mut x, mut v): (f64, f64), dt: f64) -> (f64, f64, u32) {
    let fastest = (body.damping / body.mass).max((body.stiffness / body.mass).sqrt()).max(push.omega).max(push.decay);
    let (mut left, mut events) = (dt, 0);
    let mut slips = None;
    while left > 0.0 && events < 100_000 {
        let net = push.at(0.0) - body.stiffness * x;
        let size = body.friction[0] + body.friction[1] + push.size(left) + (body.stiffness * x).abs();
        let margin = 1e-13 * size;
        let direction = slips.take().unwrap_or(if v != 0.0 {
            v.signum()
        } else if net.abs() > body.toward(net) + margin {
            net.signum()
        } else {
            0.0
        });
        let grid = instants(fastest, left);
        let event = if direction == 0.0 {
            let over = |side: f64| {
                let net = |t: f64| side * (push.at(t) - body.stiffness * x) - body.toward(side);
                first_above(&grid, margin, net).map(|t| (t, side))
            };
            let first = [over(1.0), over(-1.0)].into_iter().flatten().reduce(|a, b| if a.0 <= b.0 { a } else { b });
            slips = first.map(|(_, side)| side);
            first.map(|(t, _)| t)
        } else {
            let against = Push { value: push.value - direction * body.toward(direction), ..push };
            let slide = Slide::new(body, against, (x, v));
            let stop = first_above(&grid, slide.noise(left), |t| -direction * slide.at(t).1);
            (x, v) = slide.at(stop.unwrap_or(left));
            if stop.is_some() {
                v = 0.0;
            }
            stop
        };
        let taken = event.unwrap_or(left);
        push = push.later(taken);
        left -= taken;
        events += u32::from(event.is_some());
        if event.is_none() {
            break;
        }
    }
    (x, v, events)
}
