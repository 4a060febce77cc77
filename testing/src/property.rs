//! Random tests that compile faster. proptest's own macro compiles its runner once more for each test, a quarter to a third of the code of a
//! program of tests; here the inputs of a test are one boxed value, and the runner is compiled once, in this crate.

use std::any::Any;
use std::fmt;

use proptest::strategy::{BoxedStrategy, Strategy};
use proptest::test_runner::{Config, TestCaseResult, TestRunner, contextualize_config};

/// Tests with random inputs, written as for [`proptest::proptest`]: functions or a closure of `name in strategy`. The inputs are the same.
/// For `name: Type` write `name in any::<Type>()`.
#[macro_export]
macro_rules! proptest {
    (#![proptest_config($config:expr)]
     $($(#[$attribute:meta])* fn $name:ident($($input:pat in $strategy:expr),+ $(,)?) $body:block)*) => {$(
        $(#[$attribute])*
        fn $name() {
            $crate::proptest!($config, |($($input in $strategy),+)| $body);
        }
    )*};
    ($($(#[$attribute:meta])* fn $name:ident($($inputs:tt)+) $body:block)*) => {
        $crate::proptest! {
            #![proptest_config(::core::default::Default::default())]
            $($(#[$attribute])* fn $name($($inputs)+) $body)*
        }
    };
    (|($($inputs:tt)+)| $body:block) => {
        $crate::proptest!(::core::default::Default::default(), |($($inputs)+)| $body)
    };
    ($config:expr, |($($input:pat in $strategy:expr),+ $(,)?)| $body:block) => {
        $crate::property::check(
            $config,
            ::core::stringify!($($input),+),
            ($($crate::property::boxed($strategy),)+),
            |($($input,)+)| {
                $body
                ::core::result::Result::Ok(())
            },
        )
    };
}

/// The inputs of one run of a test.
struct Inputs {
    names: &'static str,
    values: Box<dyn Values>,
}

trait Values: Any + fmt::Debug {}
impl<T: Any + fmt::Debug> Values for T {}

impl fmt::Debug for Inputs {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "({}) = {:?}", self.names, self.values)
    }
}

/// One type for all strategies of the same values.
pub fn boxed<S: Strategy + 'static>(strategy: S) -> BoxedStrategy<S::Value> {
    strategy.boxed()
}

/// Runs a test with the inputs of a strategy; `names` are theirs, for the message.
///
/// # Panics
/// Where the test fails, with the smallest inputs found for which it does.
pub fn check<S>(config: Config, names: &'static str, inputs: S, test: impl Fn(S::Value) -> TestCaseResult)
where
    S: Strategy + 'static,
    S::Value: 'static,
{
    let inputs = inputs.prop_map(move |values| Inputs { names, values: Box::new(values) }).boxed();
    run(config, &inputs, &|inputs| {
        let values: Box<dyn Any> = inputs.values;
        test(*values.downcast().unwrap_or_else(|_| unreachable!("the strategy's own values")))
    });
}

fn run(config: Config, inputs: &BoxedStrategy<Inputs>, test: &dyn Fn(Inputs) -> TestCaseResult) {
    let mut runner = TestRunner::new(Config { failure_persistence: None, ..contextualize_config(config) });
    if let Err(error) = runner.run(inputs, test) {
        panic!("{error}\n{runner}");
    }
}
