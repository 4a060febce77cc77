//! A game wheel as a USB device, for any bus of the crate `usb-device`: a microcontroller's, or a computer's own.
//!
//! The class holds the pool of effects, and takes the host's reports from the control pipe and from its endpoint. The renderer takes a copy of the
//! pool after each change. "Device Class Definition for Human Interface Devices", version 1.11.

use usb_device::UsbError;
use usb_device::class_prelude::{
    ControlIn, ControlOut, DescriptorWriter, EndpointAddress, EndpointIn, EndpointOut, InterfaceNumber, UsbBus,
    UsbBusAllocator, UsbClass,
};
use usb_device::control::{Recipient, Request, RequestType};
use usb_device::device::{StringDescriptors, UsbDevice, UsbDeviceBuilder, UsbDeviceState, UsbVidPid};

use crate::device::{WheelMailbox, WheelStatus};
use crate::pid::{DESCRIPTOR, Input, Pool, Report};

/// The identity of a device for tests, of pid.codes; a product needs its own.
pub const IDENTITY: UsbVidPid = UsbVidPid(0x1209, 0x0001);
/// The size of a packet on every pipe, bytes.
pub const PACKET: u16 = 64;
/// The polling interval of the endpoint, ms.
const INTERVAL_MS: u8 = 1;
/// In µs: a host that reads no input report for this time, while effects play, has lost its driver.
pub const UNREAD: u64 = 500_000;
/// In µs: the largest counted time between two reports, so that a pause of the computer does not count as a lost driver.
const MAX_COUNTED_US: u64 = 50_000;

const HID: u8 = 3;
const HID_DESCRIPTOR: u8 = 0x21;
const REPORT_DESCRIPTOR: u8 = 0x22;
/// After length and type: version 1.11, no country, one descriptor, which is the report descriptor of this length.
const HID_BODY: [u8; 7] = {
    let [low, high] = (DESCRIPTOR.len() as u16).to_le_bytes();
    [0x11, 0x01, 0, 1, REPORT_DESCRIPTOR, low, high]
};

const GET_REPORT: u8 = 0x01;
const GET_IDLE: u8 = 0x02;
const GET_PROTOCOL: u8 = 0x03;
const SET_REPORT: u8 = 0x09;
const SET_IDLE: u8 = 0x0A;
const SET_PROTOCOL: u8 = 0x0B;

/// The kinds of a report in a control request.
const INPUT: u8 = 1;
const FEATURE: u8 = 3;

/// The wheel on its bus.
pub struct WheelClass<'a, B: UsbBus> {
    interface: InterfaceNumber,
    input: EndpointIn<'a, B>,
    output: EndpointOut<'a, B>,
    pool: Pool,
    shown: Input,
    /// The time of the last input report, µs.
    shown_at: u64,
    /// The counted time for which the host has read no report while effects play, µs.
    unread: u64,
    now: u64,
    changed: bool,
    taken: u64,
    refused: u64,
    idle: u8,
}

impl<'a, B: UsbBus> WheelClass<'a, B> {
    /// The class with an empty pool.
    pub fn new(bus: &'a UsbBusAllocator<B>) -> Self {
        WheelClass {
            interface: bus.interface(),
            input: bus.interrupt(PACKET, INTERVAL_MS),
            output: bus.interrupt(PACKET, INTERVAL_MS),
            pool: Pool::new(),
            shown: Input::default(),
            shown_at: 0,
            unread: 0,
            now: 0,
            changed: false,
            taken: 0,
            refused: 0,
            idle: 0,
        }
    }

    /// The USB device of this class.
    ///
    /// # Errors
    /// Never with these numbers; the crate requires a check.
    pub fn device(bus: &'a UsbBusAllocator<B>) -> Result<UsbDevice<'a, B>, UsbError> {
        let text = StringDescriptors::default().manufacturer("hapt").product("hapt wheel").serial_number("1");
        let builder = UsbDeviceBuilder::new(bus, IDENTITY).strings(&[text]).map_err(|_| UsbError::InvalidState)?;
        Ok(builder.max_packet_size_0(PACKET as u8).map_err(|_| UsbError::InvalidState)?.build())
    }

    /// Sets the time of the reports that are received from now on, in µs; it is monotonic.
    pub fn at(&mut self, now: u64) {
        self.now = now;
    }

    /// The effects.
    pub fn pool(&self) -> &Pool {
        &self.pool
    }

    /// Whether the pool has changed since the last call.
    pub fn has_changed(&mut self) -> bool {
        core::mem::take(&mut self.changed)
    }

    /// Sends the input report to the host, and starts the effects of buttons. A report that finds the endpoint busy is left out.
    ///
    /// False where the host has read no report for [`UNREAD`] while effects played: its driver has released the device, and all effects stop. A
    /// driver reads reports for as long as a program has the wheel open, and removes the effects of a program that closes it.
    pub fn show(&mut self, input: &Input) -> bool {
        let before = self.pool.revision();
        self.pool.press(input.buttons, self.now);
        self.changed |= self.pool.revision() != before;
        self.shown = *input;
        let is_taken = self.input.write(&input.write()).is_ok();
        let passed = self.now.saturating_sub(self.shown_at).min(MAX_COUNTED_US);
        self.shown_at = self.now;
        self.unread = if is_taken || !self.pool.plays(self.now) { 0 } else { self.unread + passed };
        let reads = self.unread < UNREAD;
        if !reads {
            self.stop_all();
        }
        reads
    }

    /// Reports taken, and reports refused: malformed ones, and those of effects that are not in the pool.
    pub fn counts(&self) -> (u64, u64) {
        (self.taken, self.refused)
    }

    /// Stops all effects: the host has suspended or released the device.
    pub fn stop_all(&mut self) {
        self.pool.stop_all();
        self.changed = true;
    }

    fn take(&mut self, bytes: &[u8]) -> bool {
        let Some(report) = Report::read(bytes) else {
            self.refused += 1;
            return false;
        };
        // A full pool is an answer, and no error of the report.
        let known = self.pool.take(&report, self.now) || matches!(report, Report::Create(_));
        self.changed = true;
        if known {
            self.taken += 1;
        } else {
            self.refused += 1;
        }
        known
    }

    /// Takes the packets queued at the endpoint, which were sent before the next control request.
    fn drain(&mut self) {
        let mut packet = [0; PACKET as usize];
        while let Ok(length) = self.output.read(&mut packet) {
            let _ = self.take(packet.get(..length).unwrap_or_default());
        }
    }
}

/// The main loop's half of a board that is a standalone wheel: USB on one side, the mailbox of its sampler on the other.
pub struct WheelPort<'a, B: UsbBus> {
    device: UsbDevice<'a, B>,
    class: WheelClass<'a, B>,
    half: f64,
    has_host: bool,
    /// The sampler's last state, and whether the host has not received it yet.
    shown: WheelStatus,
    is_new: bool,
}

/// The largest number of packets that are taken between two exchanges with the mailbox.
const PACKETS_AT_ONCE: usize = 8;

impl<'a, B: UsbBus> WheelPort<'a, B> {
    /// The device of the host, with a steering range of twice `half`, rad.
    ///
    /// # Errors
    /// As [`WheelClass::device`].
    pub fn new(bus: &'a UsbBusAllocator<B>, half: f64) -> Result<Self, UsbError> {
        let class = WheelClass::new(bus);
        let (device, shown) = (WheelClass::device(bus)?, WheelMailbox::new().shown());
        Ok(WheelPort { device, class, half, has_host: false, shown, is_new: false })
    }

    /// Takes and answers received packets, and sends the input report. All effects end when the host resets, suspends or releases the device, or reads no
    /// more reports.
    pub fn poll(&mut self) {
        self.class.at(self.shown.now);
        for _ in 0..PACKETS_AT_ONCE {
            let goes_on = self.device.poll(&mut [&mut self.class]);
            let has_host = self.device.state() == UsbDeviceState::Configured;
            if self.has_host && !has_host {
                self.class.stop_all();
            }
            self.has_host = has_host;
            if !goes_on {
                break;
            }
        }
        if self.has_host && core::mem::take(&mut self.is_new) {
            let _ = self.class.show(&Input::at(self.shown.position.into(), self.half));
        }
    }

    /// Passes changes to the sampler, and takes its state. The mailbox is locked for the time of copying a pool.
    pub fn exchange(&mut self, mailbox: &mut WheelMailbox) {
        let pool = self.class.has_changed().then_some(self.class.pool());
        let shown = mailbox.serve(pool, self.has_host);
        self.is_new |= shown.now != self.shown.now;
        self.shown = shown;
    }
}

impl<B: UsbBus> UsbClass<B> for WheelClass<'_, B> {
    fn get_configuration_descriptors(&self, writer: &mut DescriptorWriter) -> usb_device::Result<()> {
        writer.interface(self.interface, HID, 0, 0)?;
        writer.write(HID_DESCRIPTOR, &HID_BODY)?;
        writer.endpoint(&self.input)?;
        writer.endpoint(&self.output)
    }

    /// Handles a reset by the host.
    fn reset(&mut self) {
        self.pool = Pool::new();
        self.changed = true;
    }

    fn endpoint_out(&mut self, address: EndpointAddress) {
        if address == self.output.address() {
            self.drain();
        }
    }

    fn control_in(&mut self, transfer: ControlIn<B>) {
        let request = *transfer.request();
        if request.recipient != Recipient::Interface || request.index != u16::from(u8::from(self.interface)) {
            return;
        }
        let [low, high] = request.value.to_le_bytes();
        // An answer that does not fit ends in an error of the transfer, which the host receives.
        let _ = match (request.request_type, request.request) {
            (RequestType::Standard, Request::GET_DESCRIPTOR) if high == REPORT_DESCRIPTOR => {
                transfer.accept_with_static(DESCRIPTOR)
            }
            (RequestType::Standard, Request::GET_DESCRIPTOR) if high == HID_DESCRIPTOR => {
                let mut descriptor = [9, HID_DESCRIPTOR, 0, 0, 0, 0, 0, 0, 0];
                descriptor.iter_mut().skip(2).zip(HID_BODY).for_each(|(place, byte)| *place = byte);
                transfer.accept_with(&descriptor)
            }
            (RequestType::Class, GET_REPORT) => {
                self.drain();
                match (high, self.pool.feature(low)) {
                    (INPUT, _) => transfer.accept_with(&self.shown.write()),
                    (FEATURE, Some(feature)) => transfer.accept_with(&feature),
                    _ => transfer.reject(),
                }
            }
            (RequestType::Class, GET_IDLE) => transfer.accept_with(&[self.idle]),
            (RequestType::Class, GET_PROTOCOL) => transfer.accept_with(&[1]),
            _ => Ok(()),
        };
    }

    fn control_out(&mut self, transfer: ControlOut<B>) {
        let request = *transfer.request();
        if request.recipient != Recipient::Interface
            || request.index != u16::from(u8::from(self.interface))
            || request.request_type != RequestType::Class
        {
            return;
        }
        let _ = match request.request {
            SET_REPORT => {
                self.drain();
                if self.take(transfer.data()) { transfer.accept() } else { transfer.reject() }
            }
            SET_IDLE => {
                self.idle = request.value.to_le_bytes()[1];
                transfer.accept()
            }
            SET_PROTOCOL => transfer.accept(),
            _ => Ok(()),
        };
    }
}
