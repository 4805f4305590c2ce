//! Published methods that [`best`](crate::best) is compared with and never calls: two local
//! searches, [`rotation`] and [`treelet`], and a way to continue from a local optimum, [`rebuild`].

pub mod rebuild;
pub mod rotation;
pub mod treelet;
