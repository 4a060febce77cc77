//! The macro draws what proptest's draws, and a failed test names its smallest inputs.

use std::cell::RefCell;
use std::panic::{AssertUnwindSafe, catch_unwind};

use hapt_testing::prelude::*;

#[test]
fn a_test_draws_the_inputs_of_proptest_s_own_macro() {
    let (ours, theirs) = (RefCell::new(Vec::new()), RefCell::new(Vec::new()));
    let config = hapt_testing::cases_from(7, 400);
    proptest!(config.clone(), |(x in -1.0..1e3_f64, word in "[a-z]{0,4}", (n, flag) in (0..9_u8, any::<bool>()))| {
        ours.borrow_mut().push((x.to_bits(), word, n, flag));
    });
    proptest::proptest!(config, |(x in -1.0..1e3_f64, word in "[a-z]{0,4}", (n, flag) in (0..9_u8, any::<bool>()))| {
        theirs.borrow_mut().push((x.to_bits(), word, n, flag));
    });
    assert!(ours.borrow().len() > 1);
    assert_eq!(ours, theirs);
}

#[test]
fn a_failed_test_names_its_smallest_inputs() {
    let test = || {
        proptest!(|(n in 0..1000_u32, list in proptest::collection::vec(0..9_u8, 0..5))| {
            prop_assert!(n < 10 || list.len() < 2, "too large");
        })
    };
    let message = *catch_unwind(AssertUnwindSafe(test)).unwrap_err().downcast::<String>().unwrap();
    assert!(message.contains("too large") && message.contains("(n, list) = (10, [0, 0])"), "{message}");
}
