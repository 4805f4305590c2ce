use super::*;
use std::collections::BTreeMap;

crate::config! {
    struct Outer {
        /// Limited on both sides, without the lower end.
        part: f64 = 0.5, in (Excluded(0.0), Included(1.0));
        /// Anything finite above 0.
        factor: f64 = 2.0, in above(0.0);
        /// A list of whole numbers.
        sizes: Vec<u32> = vec![1], in 1..;
        /// Numbers by name.
        by_name: BTreeMap<String, [f64; 2]>, in ..=9.0;
        /// Other configurations.
        inner: Vec<Inner>, in Nested;
    }
    check |outer: &Outer| match outer.sizes.is_sorted() {
        true => Ok(()),
        false => Err(OutOfRange::new("sizes", "not sorted", "ascending numbers")),
    };
}

crate::config! {
    struct Inner {
        /// May be infinite.
        limit: f64 = f64::INFINITY, in 1.0..=f64::INFINITY;
    }
}

#[test]
fn a_rejection_names_the_key_the_value_and_the_accepted_values() {
    fn check(change: fn(&mut Outer)) -> Result<(), String> {
        let mut outer = Outer::default();
        change(&mut outer);
        outer.check().map_err(|error| error.to_string())
    }
    fn expect(change: fn(&mut Outer), message: &str) {
        assert_eq!(check(change), Err(message.into()));
    }
    assert_eq!(check(|_| ()), Ok(()));
    assert_eq!(check(|outer| outer.part = 1.0), Ok(()));
    expect(|outer| outer.part = 0.0, "part is 0; accepted: above 0, up to 1");
    expect(|outer| outer.part = f64::NAN, "part is NaN; accepted: above 0, up to 1");
    expect(|outer| outer.factor = f64::INFINITY, "factor is inf; accepted: above 0");
    expect(|outer| outer.sizes = vec![1, 0], "sizes[1] is 0; accepted: 1 or more");
    expect(|outer| outer.sizes = vec![2, 1], "sizes is not sorted; accepted: ascending numbers");
    expect(
        |outer| outer.by_name = BTreeMap::from([("a".into(), [0.0, 10.0])]),
        "by_name.a[1] is 10; accepted: at most 9",
    );
    expect(
        |outer| outer.inner = vec![Inner::default(), Inner { limit: 0.0 }],
        "inner[1].limit is 0; accepted: 1 to inf",
    );
}
