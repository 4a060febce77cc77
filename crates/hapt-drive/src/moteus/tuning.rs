//! The configuration of a simulated moteus: its integrator, and the limits of its torque with their codes.

/// N·m per A, and V per rev/s.
pub(super) const MOTOR: f32 = 0.1;
const BACK_EMF: f32 = 0.42;
/// In Ω.
const RESISTANCE: f32 = 0.1;
/// The usable part of the supply's voltage at a phase.
const PHASE: f32 = 0.577;

/// A part of a moteus's configuration, in the drive's own units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tuning {
    /// `servo.pid_position.ki` and `servo.pid_position.ilimit`, N·m/s per revolution and N·m.
    pub integrator: (f32, f32),
    /// `servopos.position_min` and `servopos.position_max`, in revolutions; NaN: none.
    pub position: (f32, f32),
    /// `servo.position_derate`: the distance beyond these at which the torque reaches 0, in revolutions.
    pub position_derate: f32,
    /// `servo.max_velocity` and `servo.max_velocity_derate`, rev/s.
    pub velocity: (f32, f32),
    /// `servo.max_current_A`.
    pub current: f32,
    /// `servo.max_power_W`.
    pub power: f32,
    /// The voltage of its supply, V.
    pub voltage: f32,
    /// The used part of the temperature margin of board and motor; at 1 the current is 0.
    pub heat: (f32, f32),
}

impl Tuning {
    /// No active limit, and an integrator as for position control without a steady-state error. The factory settings are an `ilimit` of 0
    /// and limits of the position at ±0.01.
    pub const TUNED: Tuning = Tuning {
        integrator: (1.0, 0.3),
        position: (f32::NAN, f32::NAN),
        position_derate: 0.02,
        velocity: (500.0, 2.0),
        current: 100.0,
        power: 450.0,
        voltage: 24.0,
        heat: (0.0, 0.0),
    };

    /// The limited torque in N·m at this position and velocity, and the code of the last active limit; 0: none.
    pub(super) fn limited(&self, torque: f32, position: Option<f32>, velocity: f32) -> (f32, i32) {
        let (mut torque, mut code) = (torque, 0);
        let mut hold = |wanted: f32, torque: &mut f32, because: i32| {
            if wanted != *torque {
                (*torque, code) = (wanted, because);
            }
        };
        if let Some(position) = position {
            // Only torque outwards is limited.
            let beyond = if torque > 0.0 { position - self.position.1 } else { self.position.0 - position };
            if beyond > 0.0 && torque != 0.0 {
                hold(torque * (1.0 - beyond / self.position_derate).max(0.0), &mut torque, 103);
            }
        }
        let most = MOTOR * self.current;
        if velocity.abs() >= self.velocity.0 && torque * velocity > 0.0 {
            let left = (1.0 - (velocity.abs() - self.velocity.0) / self.velocity.1).max(0.0) * most;
            hold(torque.clamp(-left, left), &mut torque, 96);
        }
        let (board, motor) = self.heat;
        let because = if motor > board { 101 } else { 100 };
        let heat = board.max(motor).clamp(0.0, 1.0);
        let cool = (1.0 - heat) * most;
        hold(torque.clamp(-cool, cool), &mut torque, if heat > 0.0 { because } else { 99 });
        let current = torque / MOTOR;
        let power = (current * (RESISTANCE * current + BACK_EMF * velocity)).abs();
        if power > self.power {
            hold(torque * self.power / power, &mut torque, 97);
        }
        let most = PHASE * self.voltage;
        let volts = RESISTANCE * torque / MOTOR + BACK_EMF * velocity;
        if volts.abs() > most {
            // The motor cannot brake harder than at zero current.
            let left = (volts.clamp(-most, most) - BACK_EMF * velocity) * MOTOR / RESISTANCE;
            hold(if left * torque > 0.0 { left } else { 0.0 }, &mut torque, 98);
        }
        (torque, code)
    }
}
