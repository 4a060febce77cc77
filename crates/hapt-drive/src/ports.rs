//! The connected ports by the system's own files: serial ports on USB and CAN interfaces.

use std::fs;
use std::path::{Path, PathBuf};

/// A serial port or a CAN interface.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Port {
    /// The port's path or the interface's name.
    pub name: String,
    /// Its description: product and serial number, or whether the interface is up.
    pub says: String,
    /// The possible values of `--device`; empty where no known drive matches.
    pub specs: Vec<String>,
}

/// USB vendor and product of adapters for drives, and of boards that makers use with SimpleFOC (ESP32, RP2040, Teensy), and the make in
/// their address.
const ADAPTERS: [(&str, &str, &str); 7] = [
    ("0483", "5740", "moteus"),
    ("1209", "2323", "moteus"),
    ("16d0", "117e", "odrive"),
    ("ad50", "60c4", "odrive"),
    ("303a", "1001", "simplefoc"),
    ("2e8a", "000a", "simplefoc"),
    ("16c0", "0483", "simplefoc"),
];
/// The kernel's number of CAN among the types of network interfaces.
const CAN: &str = "280";

/// All of them, by name: CAN interfaces first.
pub fn ports() -> Vec<Port> {
    ports_in(Path::new("/sys"))
}

fn ports_in(sys: &Path) -> Vec<Port> {
    let mut ports = Vec::new();
    for (name, path) in entries(&sys.join("class/net")) {
        if line(&path.join("type")).as_deref() == Some(CAN) {
            let up =
                line(&path.join("flags")).and_then(|flags| u32::from_str_radix(flags.strip_prefix("0x")?, 16).ok());
            let says =
                if up.is_some_and(|flags| flags & 1 == 1) { "a CAN interface, up" } else { "a CAN interface, down" };
            let specs = vec![format!("moteus:{name}"), format!("odrive:{name}")];
            ports.push(Port { name, says: says.into(), specs });
        }
    }
    for (name, path) in entries(&sys.join("class/tty")) {
        // Ports without a device are consoles.
        let Some(usb) = path.join("device").canonicalize().ok().and_then(|device| usb(&device)) else { continue };
        let name = format!("/dev/{name}");
        let says = [usb.product, usb.serial].into_iter().flatten().collect::<Vec<_>>().join(", ");
        let known = ADAPTERS.iter().find(|(vendor, product, _)| (*vendor, *product) == (&usb.ids.0, &usb.ids.1));
        let specs = known.map(|(.., word)| format!("{word}:{name}")).into_iter().collect();
        ports.push(Port { name, says, specs });
    }
    ports
}

struct Usb {
    ids: (String, String),
    product: Option<String>,
    serial: Option<String>,
}

/// The USB device that a port belongs to: the first above it that has a vendor.
fn usb(device: &Path) -> Option<Usb> {
    device.ancestors().find_map(|above| {
        let ids = (line(&above.join("idVendor"))?, line(&above.join("idProduct"))?);
        Some(Usb { ids, product: line(&above.join("product")), serial: line(&above.join("serial")) })
    })
}

fn line(path: &Path) -> Option<String> {
    Some(fs::read_to_string(path).ok()?.trim().to_string())
}

fn entries(folder: &Path) -> Vec<(String, PathBuf)> {
    let named = |entry: fs::DirEntry| (entry.file_name().to_string_lossy().into_owned(), entry.path());
    let mut entries: Vec<_> = fs::read_dir(folder).into_iter().flatten().flatten().map(named).collect();
    entries.sort();
    entries
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn adapters_and_interfaces_are_identified_by_the_systems_files() {
        let sys = std::env::temp_dir().join(format!("hapt-ports-{}", std::process::id()));
        let file = |path: &str, text: &str| {
            let path = sys.join(path);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, text).unwrap();
        };
        file("class/net/can0/type", "280\n");
        file("class/net/can0/flags", "0x1\n");
        file("class/net/eth0/type", "1\n");
        file("devices/usb1/1-1/idVendor", "1209\n");
        file("devices/usb1/1-1/idProduct", "2323\n");
        file("devices/usb1/1-1/product", "mjcanfd-usb-1x\n");
        file("devices/usb1/1-1/serial", "AB12\n");
        file("devices/usb1/1-1/1-1:1.0/here", "");
        file("class/tty/ttyACM0/dev", "");
        file("class/tty/tty0/dev", "");
        std::os::unix::fs::symlink(sys.join("devices/usb1/1-1/1-1:1.0"), sys.join("class/tty/ttyACM0/device")).unwrap();
        let seen = ports_in(&sys);
        fs::remove_dir_all(&sys).unwrap();
        let names: Vec<&str> = seen.iter().map(|port| port.name.as_str()).collect();
        assert_eq!(names, ["can0", "/dev/ttyACM0"]);
        assert_eq!(seen[0].specs, ["moteus:can0", "odrive:can0"]);
        assert_eq!(
            (seen[1].says.as_str(), &seen[1].specs),
            ("mjcanfd-usb-1x, AB12", &vec!["moteus:/dev/ttyACM0".to_string()])
        );
    }
}
