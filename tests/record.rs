//! Everything that is said can be kept, looked at, said again, replayed and explained.

mod files;
mod replay;
mod tap;
mod top;
