//! Worlds as C: the same bits as the core's, and no world that C cannot hold.

mod bits;
mod compiler;
mod lecture;
mod options;
mod refused;
mod tune;
mod worlds;
