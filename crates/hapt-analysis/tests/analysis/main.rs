//! The certificate, the margins and the remedies, against closed forms, the real loop and brute force.

mod check;
mod claims;
mod common;
mod critical;
mod decomposition;
mod device_friction;
mod device_stops;
mod device_torque;
mod discrete;
mod felt;
mod free;
mod grip;
mod handle;
mod held;
mod integral;
mod kalman;
mod passivity;
mod patterns;
mod published;
mod recentre;
mod remedies;
mod side;
mod two_rates;
mod within_friction;
mod witnesses;
mod z_width;
