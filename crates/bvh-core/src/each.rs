//! Small arrays, element by element.

/// Maps arrays by code that is always a part of its caller.
///
/// `array::map` is a function of its own, which a build in several units does not inline. It took a
/// third of the time of a bake in the builds of tests. What runs once for a tree may call it.
pub(crate) trait Each<T> {
    /// The array of other elements.
    type Of<U>;

    fn each<U>(self, of: impl FnMut(T) -> U) -> Self::Of<U>;
}

macro_rules! each {
    ($($N:literal: $($element:ident)*;)*) => {
        $(impl<T> Each<T> for [T; $N] {
            type Of<U> = [U; $N];

            #[inline(always)]
            fn each<U>(self, mut of: impl FnMut(T) -> U) -> [U; $N] {
                let [$($element),*] = self;
                [$(of($element)),*]
            }
        })*
    };
}

each! {
    2: a b;
    3: a b c;
    4: a b c d;
}
