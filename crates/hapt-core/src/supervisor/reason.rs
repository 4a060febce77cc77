//! Reasons for removing the torque: codes, names, sentences and remedies.

crate::named! {
    /// The reason for removing the torque. The codes are used on wires and in logs, and never change their meaning.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    #[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
    #[repr(u8)]
    pub enum Reason {
        /// Stop was pressed.
        Stop = 1 => "stop",
        /// A position, a velocity, a time or a torque is not finite.
        NotFinite = 2 => "not-finite",
        /// The velocity changed by more in one sample than a hand or the motor can cause.
        Jump = 3 => "jump",
        /// The position changed faster than the device can move.
        Velocity = 4 => "velocity",
        /// The position stood still under a torque that should have moved it.
        Stuck = 5 => "stuck",
        /// The command exceeds its limit.
        Torque = 6 => "torque",
        /// The torque changed by more in one sample than this world can cause.
        Slew = 7 => "slew",
        /// The motor reaches its thermal limit.
        Heat = 8 => "heat",
        /// The driver reaches its thermal limit.
        DriverHeat = 9 => "driver-heat",
        /// With the motor on, the puck is faster than a hand moves it.
        Overspeed = 10 => "overspeed",
        /// A sample is late, or samples were missed.
        Late = 11 => "late",
        /// The heartbeat of the client in control timed out.
        Link = 12 => "link",
        /// The hand received more energy than the loop had stored.
        PortEnergy = 13 => "port-energy",
        /// The integration method generated energy.
        WorldEnergy = 14 => "world-energy",
        /// On arming, a test pulse moved the puck the wrong way.
        Reversed = 15 => "reversed",
        /// The motor driver reported a fault and switched itself off.
        Driver = 16 => "driver",
        /// A sample or a command came later than the certificate covers.
        Uneven = 17 => "uneven",
    }
}

impl Reason {
    /// Its code on wires and in logs, 1 and up; 0 stands for no reason.
    pub const fn code(self) -> u8 {
        self as u8
    }

    /// The reason of a code.
    pub fn from_code(code: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|reason| reason.code() == code)
    }

    /// What happened.
    pub const fn sentence(self) -> &'static str {
        match self {
            Reason::Stop => "Stop was pressed.",
            Reason::NotFinite => "A position, a time or a torque is not a finite number.",
            Reason::Jump => "The position jumped: no hand changes the puck's speed so much within one sample.",
            Reason::Velocity => "The position ran faster than the device can turn.",
            Reason::Stuck => "The position stood still against a torque that should have moved the puck.",
            Reason::Torque => "The loop commanded more torque than safety.torque allows.",
            Reason::Slew => "The torque changed by more than this world can cause in one sample.",
            Reason::Heat => "The motor held more torque than its thermal limit allows.",
            Reason::DriverHeat => "The driver carried more current than its thermal limit allows.",
            Reason::Overspeed => "The puck turned faster than a hand turns it, with the motor on.",
            Reason::Late => "A sample came too late, or samples were missed.",
            Reason::Link => "No heartbeat arrived in time from the client in control.",
            Reason::PortEnergy => "The loop gave the hand more energy than the hand had supplied.",
            Reason::WorldEnergy => "The integration method generated energy inside the world.",
            Reason::Reversed => "A small pulse of torque moved the puck the wrong way.",
            Reason::Driver => "The motor's driver reported a fault, such as too much current, and switched itself off.",
            Reason::Uneven => "A sample or a command came later than the certificate covers.",
        }
    }

    /// How to clear it, and what prevents it.
    pub const fn remedy(self) -> &'static str {
        match self {
            Reason::Stop => "Release the stop, then clear.",
            Reason::NotFinite => {
                "Clear. If it returns, the world diverges (check it) or the device sends invalid numbers."
            }
            Reason::Jump => "Check the encoder's cable and safety.jump, then clear.",
            Reason::Velocity => "Let the puck come to rest, check the encoder and safety.velocity, then clear.",
            Reason::Stuck => {
                "Release the puck, check the encoder's cable, then clear and arm. For a hand that holds it still for longer, raise safety.stuck."
            }
            Reason::Torque => "Raise safety.torque or lower device.limit, then clear.",
            Reason::Slew => "Find what changed the torque; raise safety.slew if the change is intended; then clear.",
            Reason::Heat => "Wait until the motor has cooled, then clear. safety.rms and safety.heating set the limit.",
            Reason::DriverHeat => {
                "Wait until the driver has cooled, then clear. safety.driver_rms and safety.driver_heating set the limit."
            }
            Reason::Overspeed => {
                "Let the puck come to rest, then clear. If it ran away by itself, check the world and the motor's sign."
            }
            Reason::Late => "Clear when samples are on time again. `hapt latency` measures the computer's timing.",
            Reason::Link => "Clear, if it faulted, and arm when the link is back.",
            Reason::PortEnergy => {
                "Clear. `hapt check` decides whether the world is passive on this device, and lists remedies."
            }
            Reason::WorldEnergy => {
                "Clear, and choose a method that generates no energy: zoh, trapezoidal or backward-euler."
            }
            Reason::Reversed => {
                "Swap the motor's sign or the encoder's direction, then clear. If a hand was on the puck: release it, clear and arm again."
            }
            Reason::Driver => {
                "Check the motor and its cable for a short circuit, and the driver's supply and current limit, then clear."
            }
            Reason::Uneven => {
                "Clear, if it faulted, and arm. `hapt latency` measures the times; certify longer loop.interval_max and loop.delay_max, or set safety.late."
            }
        }
    }

    /// Whether the measured velocity is still valid after it, so that damping may bring the puck to rest.
    pub const fn trusts_the_encoder(self) -> bool {
        match self {
            Reason::Stop | Reason::Overspeed | Reason::Link | Reason::PortEnergy | Reason::WorldEnergy => true,
            Reason::NotFinite
            | Reason::Jump
            | Reason::Velocity
            | Reason::Stuck
            | Reason::Torque
            | Reason::Slew
            | Reason::Heat
            | Reason::DriverHeat
            | Reason::Late
            | Reason::Reversed
            | Reason::Driver
            | Reason::Uneven => false,
        }
    }
}
