//! The constants of a compiled world, as the core names them.

use hapt_core::{Constants, Controller, Limits, Real, Spec};

use crate::Error;

/// Capacity for bodies, couplings, and remembered counts.
const BODIES: usize = 8;
const COUPLINGS: usize = 32;
const COUNTS: usize = 257;

/// All numbers of a compiled world and its supervisor.
pub(crate) fn collected<F: Real>(spec: &Spec, limits: &Limits) -> Result<Collected, Error> {
    let controller = Controller::<F, BODIES, COUPLINGS, COUNTS>::new(spec, limits)?;
    let mut collected = Collected::default();
    controller.world().constants(&mut collected);
    controller.supervisor().constants(&mut collected);
    Ok(collected)
}

/// A number, or several in rows.
#[derive(Clone, Debug)]
pub(crate) struct Constant {
    pub name: &'static str,
    pub about: &'static str,
    /// Empty for a single number.
    pub shape: Vec<usize>,
    pub values: Vec<f64>,
}

/// One element of a list: its kind, whole numbers, and numbers.
#[derive(Clone, Debug)]
pub(crate) struct Element {
    pub list: &'static str,
    pub kind: &'static str,
    pub wholes: Vec<(&'static str, i64)>,
    pub numbers: Vec<Constant>,
}

/// All of a world's.
#[derive(Clone, Debug, Default)]
pub(crate) struct Collected {
    pub wholes: Vec<(&'static str, i64)>,
    pub numbers: Vec<Constant>,
    pub elements: Vec<Element>,
    is_open: bool,
}

impl Collected {
    fn put(&mut self, constant: Constant) {
        match self.elements.last_mut().filter(|_| self.is_open) {
            Some(element) => element.numbers.push(constant),
            None => self.numbers.push(constant),
        }
    }

    /// A whole number of the world.
    pub fn whole(&self, name: &str) -> Option<i64> {
        self.wholes.iter().find(|(this, _)| *this == name).map(|(_, value)| *value)
    }

    /// The elements of a list.
    pub fn list<'a>(&'a self, list: &'a str) -> impl Iterator<Item = &'a Element> {
        self.elements.iter().filter(move |element| element.list == list)
    }
}

impl Constants for Collected {
    fn whole(&mut self, name: &'static str, _: &'static str, value: i64) {
        match self.elements.last_mut().filter(|_| self.is_open) {
            Some(element) => element.wholes.push((name, value)),
            None => self.wholes.push((name, value)),
        }
    }

    fn number(&mut self, name: &'static str, about: &'static str, value: f64) {
        self.put(Constant { name, about, shape: Vec::new(), values: vec![value] });
    }

    fn array(&mut self, name: &'static str, about: &'static str, shape: &[usize], at: &dyn Fn(usize) -> f64) {
        let values = (0..shape.iter().product()).map(at).collect();
        self.put(Constant { name, about, shape: shape.to_vec(), values });
    }

    fn element(&mut self, list: &'static str, kind: &'static str) {
        self.elements.push(Element { list, kind, wholes: Vec::new(), numbers: Vec::new() });
        self.is_open = true;
    }

    fn end(&mut self) {
        self.is_open = false;
    }
}
