//! The report descriptor of a force-feedback wheel: "Device Class Definition for Physical Interface Devices", version 1.0, and the HID Usage
//! Tables, page 0x0F.

/// Report ids, to the device and from it.
pub mod id {
    /// Input: steering, pedals, buttons.
    pub const WHEEL: u8 = 1;
    /// Output: an effect's type, duration, gain, trigger and direction.
    pub const EFFECT: u8 = 2;
    /// Output: an effect's attack and fade.
    pub const ENVELOPE: u8 = 3;
    /// Output: offset, coefficients, saturations and dead band of a condition.
    pub const CONDITION: u8 = 4;
    /// Output: magnitude, offset, phase and period.
    pub const PERIODIC: u8 = 5;
    /// Output: a constant force's magnitude.
    pub const CONSTANT: u8 = 6;
    /// Output: a ramp's start and end.
    pub const RAMP: u8 = 7;
    /// Output: start, start solo, stop.
    pub const OPERATION: u8 = 8;
    /// Output: removes an effect from the pool.
    pub const FREE: u8 = 9;
    /// Output: enable, disable, stop all, reset, pause, continue.
    pub const CONTROL: u8 = 10;
    /// Output: the gain of all effects.
    pub const GAIN: u8 = 11;
    /// Feature, written: asks for a place for an effect of a type.
    pub const CREATE: u8 = 12;
    /// Feature, read: the place, or why there is none.
    pub const LOAD: u8 = 13;
    /// Feature, read: the pool's size.
    pub const POOL: u8 = 14;
}

/// The full scale of levels, coefficients, saturations and gains.
pub const FULL: i16 = 10_000;
/// A duration without end.
pub const INFINITE: u16 = 0xffff;
/// Effects in the pool.
pub const EFFECTS: usize = 16;
/// Buttons of the wheel.
pub const BUTTONS: u32 = 16;

/// One line an item. Levels are 16 bits within ±10000, times 16 bits in ms, directions and phases in 1/100 degree.
#[rustfmt::skip]
pub const DESCRIPTOR: &[u8] = &[
    0x05, 0x01,             // Usage Page (Generic Desktop)
    0x09, 0x04,             // Usage (Joystick)
    0xA1, 0x01,             // Collection (Application)
    0x85, id::WHEEL,        //   Report ID
    0x09, 0x30,             //   Usage (X): the steering
    0x16, 0x01, 0x80,       //   Logical Minimum (-32767)
    0x26, 0xFF, 0x7F,       //   Logical Maximum (32767)
    0x75, 0x10, 0x95, 0x01, //   Report Size (16), Count (1)
    0x81, 0x02,             //   Input (Data, Var, Abs)
    0x09, 0x31,             //   Usage (Y): throttle
    0x09, 0x32,             //   Usage (Z): brake
    0x09, 0x35,             //   Usage (Rz): clutch
    0x15, 0x00,             //   Logical Minimum (0)
    0x95, 0x03,             //   Report Count (3)
    0x81, 0x02,             //   Input (Data, Var, Abs)
    0x05, 0x09,             //   Usage Page (Button)
    0x19, 0x01, 0x29, 0x10, //   Usage Minimum (1), Maximum (16)
    0x25, 0x01,             //   Logical Maximum (1)
    0x75, 0x01, 0x95, 0x10, //   Report Size (1), Count (16)
    0x81, 0x02,             //   Input (Data, Var, Abs)
    0x05, 0x0F,             //   Usage Page (Physical Interface)

    0x09, 0x21, 0xA1, 0x02, //   Set Effect Report: Collection (Logical)
    0x85, id::EFFECT,       //     Report ID
    0x09, 0x22,             //     Usage (Effect Block Index)
    0x15, 0x01, 0x25, 0x10, //     Logical 1 to 16
    0x75, 0x08, 0x95, 0x01, //     Report Size (8), Count (1)
    0x91, 0x02,             //     Output (Data, Var, Abs)
    0x09, 0x25, 0xA1, 0x02, //     Effect Type: Collection (Logical)
    0x09, 0x26, 0x09, 0x27, //       Constant, Ramp
    0x09, 0x30, 0x09, 0x31, //       Square, Sine
    0x09, 0x32, 0x09, 0x33, //       Triangle, Sawtooth Up
    0x09, 0x34, 0x09, 0x40, //       Sawtooth Down, Spring
    0x09, 0x41, 0x09, 0x42, //       Damper, Inertia
    0x09, 0x43,             //       Friction
    0x15, 0x01, 0x25, 0x0B, //       Logical 1 to 11
    0x91, 0x00,             //       Output (Data, Array)
    0xC0,                   //     End Collection
    0x09, 0x50,             //     Usage (Duration)
    0x09, 0x54,             //     Usage (Trigger Repeat Interval)
    0x09, 0xA7,             //     Usage (Start Delay)
    0x15, 0x00,             //     Logical Minimum (0)
    0x27, 0xFF, 0xFF, 0, 0, //     Logical Maximum (65535)
    0x35, 0x00,             //     Physical Minimum (0)
    0x47, 0xFF, 0xFF, 0, 0, //     Physical Maximum (65535)
    0x66, 0x01, 0x10,       //     Unit (s)
    0x55, 0x0D,             //     Unit Exponent (-3)
    0x75, 0x10, 0x95, 0x03, //     Report Size (16), Count (3)
    0x91, 0x02,             //     Output (Data, Var, Abs)
    0x55, 0x00,             //     Unit Exponent (0)
    0x66, 0x00, 0x00,       //     Unit (none)
    0x45, 0x00,             //     Physical Maximum (0): as logical
    0x09, 0x52,             //     Usage (Gain)
    0x26, 0x10, 0x27,       //     Logical Maximum (10000)
    0x95, 0x01,             //     Report Count (1)
    0x91, 0x02,             //     Output (Data, Var, Abs)
    0x09, 0x53,             //     Usage (Trigger Button)
    0x26, 0xFF, 0x00,       //     Logical Maximum (255)
    0x75, 0x08,             //     Report Size (8)
    0x91, 0x02,             //     Output (Data, Var, Abs)
    0x09, 0x55, 0xA1, 0x02, //     Axes Enable: Collection (Logical)
    0x05, 0x01, 0x09, 0x30, //       Generic Desktop: X
    0x25, 0x01,             //       Logical Maximum (1)
    0x75, 0x01,             //       Report Size (1)
    0x91, 0x02,             //       Output (Data, Var, Abs)
    0xC0,                   //     End Collection
    0x05, 0x0F, 0x09, 0x56, //     Physical Interface: Direction Enable
    0x91, 0x02,             //     Output (Data, Var, Abs)
    0x95, 0x06, 0x91, 0x03, //     Output (Constant): 6 bits
    0x09, 0x57, 0xA1, 0x02, //     Direction: Collection (Logical)
    0x0B, 0x01, 0, 0x0A, 0, //       Usage (Ordinals: Instance 1)
    0x27, 0x9F, 0x8C, 0, 0, //       Logical Maximum (35999)
    0x66, 0x14, 0x00,       //       Unit (degrees)
    0x55, 0x0E,             //       Unit Exponent (-2)
    0x75, 0x10, 0x95, 0x01, //       Report Size (16), Count (1)
    0x91, 0x02,             //       Output (Data, Var, Abs)
    0x55, 0x00,             //       Unit Exponent (0)
    0x66, 0x00, 0x00,       //       Unit (none)
    0xC0,                   //     End Collection
    0xC0,                   //   End Collection

    0x09, 0x5A, 0xA1, 0x02, //   Set Envelope Report: Collection (Logical)
    0x85, id::ENVELOPE,     //     Report ID
    0x09, 0x22,             //     Usage (Effect Block Index)
    0x15, 0x01, 0x25, 0x10, //     Logical 1 to 16
    0x75, 0x08, 0x91, 0x02, //     Report Size (8), Output
    0x09, 0x5B, 0x09, 0x5D, //     Usage (Attack Level), (Fade Level)
    0x15, 0x00,             //     Logical Minimum (0)
    0x26, 0x10, 0x27,       //     Logical Maximum (10000)
    0x75, 0x10, 0x95, 0x02, //     Report Size (16), Count (2)
    0x91, 0x02,             //     Output (Data, Var, Abs)
    0x09, 0x5C, 0x09, 0x5E, //     Usage (Attack Time), (Fade Time)
    0x27, 0xFF, 0xFF, 0, 0, //     Logical Maximum (65535)
    0x47, 0xFF, 0xFF, 0, 0, //     Physical Maximum (65535)
    0x66, 0x01, 0x10,       //     Unit (s)
    0x55, 0x0D,             //     Unit Exponent (-3)
    0x91, 0x02,             //     Output (Data, Var, Abs)
    0x45, 0x00, 0x55, 0x00, //     Physical Maximum (0), Unit Exponent (0)
    0x66, 0x00, 0x00,       //     Unit (none)
    0xC0,                   //   End Collection

    0x09, 0x5F, 0xA1, 0x02, //   Set Condition Report: Collection (Logical)
    0x85, id::CONDITION,    //     Report ID
    0x09, 0x22,             //     Usage (Effect Block Index)
    0x15, 0x01, 0x25, 0x10, //     Logical 1 to 16
    0x75, 0x08, 0x95, 0x01, //     Report Size (8), Count (1)
    0x91, 0x02,             //     Output (Data, Var, Abs)
    0x09, 0x23,             //     Usage (Parameter Block Offset)
    0x15, 0x00, 0x25, 0x01, //     Logical 0 to 1
    0x91, 0x02,             //     Output (Data, Var, Abs)
    0x09, 0x60,             //     Usage (CP Offset)
    0x09, 0x61, 0x09, 0x62, //     Usage (Positive, Negative Coefficient)
    0x16, 0xF0, 0xD8,       //     Logical Minimum (-10000)
    0x26, 0x10, 0x27,       //     Logical Maximum (10000)
    0x75, 0x10, 0x95, 0x03, //     Report Size (16), Count (3)
    0x91, 0x02,             //     Output (Data, Var, Abs)
    0x09, 0x63, 0x09, 0x64, //     Usage (Positive, Negative Saturation)
    0x09, 0x65,             //     Usage (Dead Band)
    0x15, 0x00,             //     Logical Minimum (0)
    0x91, 0x02,             //     Output (Data, Var, Abs)
    0xC0,                   //   End Collection

    0x09, 0x6E, 0xA1, 0x02, //   Set Periodic Report: Collection (Logical)
    0x85, id::PERIODIC,     //     Report ID
    0x09, 0x22,             //     Usage (Effect Block Index)
    0x15, 0x01, 0x25, 0x10, //     Logical 1 to 16
    0x75, 0x08, 0x95, 0x01, //     Report Size (8), Count (1)
    0x91, 0x02,             //     Output (Data, Var, Abs)
    0x09, 0x70, 0x09, 0x6F, //     Usage (Magnitude), (Offset)
    0x16, 0xF0, 0xD8,       //     Logical Minimum (-10000)
    0x26, 0x10, 0x27,       //     Logical Maximum (10000)
    0x75, 0x10, 0x95, 0x02, //     Report Size (16), Count (2)
    0x91, 0x02,             //     Output (Data, Var, Abs)
    0x09, 0x71,             //     Usage (Phase)
    0x15, 0x00,             //     Logical Minimum (0)
    0x27, 0x9F, 0x8C, 0, 0, //     Logical Maximum (35999)
    0x66, 0x14, 0x00,       //     Unit (degrees)
    0x55, 0x0E, 0x95, 0x01, //     Unit Exponent (-2), Report Count (1)
    0x91, 0x02,             //     Output (Data, Var, Abs)
    0x09, 0x72,             //     Usage (Period)
    0x27, 0xFF, 0xFF, 0, 0, //     Logical Maximum (65535)
    0x47, 0xFF, 0xFF, 0, 0, //     Physical Maximum (65535)
    0x66, 0x01, 0x10,       //     Unit (s)
    0x55, 0x0D,             //     Unit Exponent (-3)
    0x91, 0x02,             //     Output (Data, Var, Abs)
    0x45, 0x00, 0x55, 0x00, //     Physical Maximum (0), Unit Exponent (0)
    0x66, 0x00, 0x00,       //     Unit (none)
    0xC0,                   //   End Collection

    0x09, 0x73, 0xA1, 0x02, //   Set Constant Force Report: Collection (Logical)
    0x85, id::CONSTANT,     //     Report ID
    0x09, 0x22,             //     Usage (Effect Block Index)
    0x15, 0x01, 0x25, 0x10, //     Logical 1 to 16
    0x75, 0x08, 0x91, 0x02, //     Report Size (8), Output
    0x09, 0x70,             //     Usage (Magnitude)
    0x16, 0xF0, 0xD8,       //     Logical Minimum (-10000)
    0x26, 0x10, 0x27,       //     Logical Maximum (10000)
    0x75, 0x10, 0x91, 0x02, //     Report Size (16), Output
    0xC0,                   //   End Collection

    0x09, 0x74, 0xA1, 0x02, //   Set Ramp Force Report: Collection (Logical)
    0x85, id::RAMP,         //     Report ID
    0x09, 0x22,             //     Usage (Effect Block Index)
    0x15, 0x01, 0x25, 0x10, //     Logical 1 to 16
    0x75, 0x08, 0x91, 0x02, //     Report Size (8), Output
    0x09, 0x75, 0x09, 0x76, //     Usage (Ramp Start), (Ramp End)
    0x16, 0xF0, 0xD8,       //     Logical Minimum (-10000)
    0x26, 0x10, 0x27,       //     Logical Maximum (10000)
    0x75, 0x10, 0x95, 0x02, //     Report Size (16), Count (2)
    0x91, 0x02,             //     Output (Data, Var, Abs)
    0xC0,                   //   End Collection

    0x09, 0x77, 0xA1, 0x02, //   Effect Operation Report: Collection (Logical)
    0x85, id::OPERATION,    //     Report ID
    0x09, 0x22,             //     Usage (Effect Block Index)
    0x15, 0x01, 0x25, 0x10, //     Logical 1 to 16
    0x75, 0x08, 0x95, 0x01, //     Report Size (8), Count (1)
    0x91, 0x02,             //     Output (Data, Var, Abs)
    0x09, 0x78, 0xA1, 0x02, //     Effect Operation: Collection (Logical)
    0x09, 0x79, 0x09, 0x7A, //       Start, Start Solo
    0x09, 0x7B,             //       Stop
    0x25, 0x03, 0x91, 0x00, //       Logical Maximum (3), Output (Data, Array)
    0xC0,                   //     End Collection
    0x09, 0x7C,             //     Usage (Loop Count)
    0x15, 0x00,             //     Logical Minimum (0)
    0x26, 0xFF, 0x00,       //     Logical Maximum (255)
    0x91, 0x02,             //     Output (Data, Var, Abs)
    0xC0,                   //   End Collection

    0x09, 0x90, 0xA1, 0x02, //   Block Free Report: Collection (Logical)
    0x85, id::FREE,         //     Report ID
    0x09, 0x22,             //     Usage (Effect Block Index)
    0x15, 0x01, 0x25, 0x10, //     Logical 1 to 16
    0x91, 0x02,             //     Output (Data, Var, Abs)
    0xC0,                   //   End Collection

    0x09, 0x95, 0xA1, 0x02, //   Device Control Report: Collection (Logical)
    0x85, id::CONTROL,      //     Report ID
    0x09, 0x96, 0xA1, 0x02, //     Device Control: Collection (Logical)
    0x09, 0x97, 0x09, 0x98, //       Enable Actuators, Disable Actuators
    0x09, 0x99, 0x09, 0x9A, //       Stop All Effects, Reset
    0x09, 0x9B, 0x09, 0x9C, //       Pause, Continue
    0x25, 0x06, 0x91, 0x00, //       Logical Maximum (6), Output (Data, Array)
    0xC0,                   //     End Collection
    0xC0,                   //   End Collection

    0x09, 0x7D, 0xA1, 0x02, //   Device Gain Report: Collection (Logical)
    0x85, id::GAIN,         //     Report ID
    0x09, 0x7E,             //     Usage (Device Gain)
    0x15, 0x00,             //     Logical Minimum (0)
    0x26, 0x10, 0x27,       //     Logical Maximum (10000)
    0x75, 0x10, 0x91, 0x02, //     Report Size (16), Output
    0xC0,                   //   End Collection

    0x09, 0xAB, 0xA1, 0x02, //   Create New Effect Report: Collection (Logical)
    0x85, id::CREATE,       //     Report ID
    0x09, 0x25, 0xA1, 0x02, //     Effect Type: Collection (Logical)
    0x09, 0x26, 0x09, 0x27, //       Constant, Ramp
    0x09, 0x30, 0x09, 0x31, //       Square, Sine
    0x09, 0x32, 0x09, 0x33, //       Triangle, Sawtooth Up
    0x09, 0x34, 0x09, 0x40, //       Sawtooth Down, Spring
    0x09, 0x41, 0x09, 0x42, //       Damper, Inertia
    0x09, 0x43,             //       Friction
    0x15, 0x01, 0x25, 0x0B, //       Logical 1 to 11
    0x75, 0x08, 0xB1, 0x00, //       Report Size (8), Feature (Data, Array)
    0xC0,                   //     End Collection
    0xC0,                   //   End Collection

    0x09, 0x89, 0xA1, 0x02, //   Block Load Report: Collection (Logical)
    0x85, id::LOAD,         //     Report ID
    0x09, 0x22,             //     Usage (Effect Block Index)
    0x15, 0x01, 0x25, 0x10, //     Logical 1 to 16: were it from 0, Linux would take effect 0 for a centring spring
    0xB1, 0x02,             //     Feature (Data, Var, Abs)
    0x09, 0x8B, 0xA1, 0x02, //     Block Load Status: Collection (Logical)
    0x09, 0x8C, 0x09, 0x8D, //       Success, Full
    0x09, 0x8E,             //       Error
    0x15, 0x01, 0x25, 0x03, //       Logical 1 to 3
    0xB1, 0x00,             //       Feature (Data, Array)
    0xC0,                   //     End Collection
    0x09, 0xAC,             //     Usage (RAM Pool Available)
    0x15, 0x00,             //     Logical Minimum (0)
    0x27, 0xFF, 0xFF, 0, 0, //     Logical Maximum (65535)
    0x75, 0x10, 0xB1, 0x02, //     Report Size (16), Feature (Data, Var, Abs)
    0xC0,                   //   End Collection

    0x09, 0x7F, 0xA1, 0x02, //   PID Pool Report: Collection (Logical)
    0x85, id::POOL,         //     Report ID
    0x09, 0x80,             //     Usage (RAM Pool Size)
    0xB1, 0x02,             //     Feature (Data, Var, Abs)
    0x09, 0x83,             //     Usage (Simultaneous Effects Maximum)
    0x26, 0xFF, 0x00,       //     Logical Maximum (255)
    0x75, 0x08, 0xB1, 0x02, //     Report Size (8), Feature
    0x09, 0xA9,             //     Usage (Device Managed Pool)
    0x25, 0x01,             //     Logical Maximum (1)
    0x75, 0x01, 0xB1, 0x02, //     Report Size (1), Feature
    0x95, 0x07, 0xB1, 0x03, //     Feature (Constant): 7 bits
    0xC0,                   //   End Collection
    0xC0,                   // End Collection
];
