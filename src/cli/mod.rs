//! The commands: arguments in, a summary or an error out. Only `main` prints and exits.

pub mod perceive;
