//! Replaces `attached.rs` where the kernel is not Linux: there is no virtual USB controller.

use hapt_host::WheelView;
use hapt_model::World;
use hapt_rt::EffectsPort;

use crate::args::Steering;
use crate::failure::Failure;

pub fn missing() -> Failure {
    Failure::System("hapt wheel needs Linux, whose kernel has a virtual USB controller (vhci-hcd)".into())
}

/// Never constructed.
pub enum Wheel {}

impl Wheel {
    pub fn room(_: &World, _: Steering) -> Result<Wheel, Failure> {
        Err(missing())
    }

    pub fn attach(room: Wheel) -> Result<(Self, EffectsPort), Failure> {
        match room {}
    }

    pub fn view(&self) -> Box<dyn WheelView> {
        match *self {}
    }

    pub fn is_attached(&self) -> bool {
        match *self {}
    }

    pub fn say(&mut self) {
        match *self {}
    }

    pub fn end(&mut self) -> String {
        match *self {}
    }
}
