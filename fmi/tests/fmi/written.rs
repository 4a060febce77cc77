//! FMUs as files.

use std::io::{Cursor, Read};
use std::path::PathBuf;

use hapt_fmi::{Kind, Platform, Version, write};
use hapt_model::{Source, World, builtin, parameters};
use zip::ZipArchive;

use crate::fmu::WHEEL;

/// A library's header, and the name of a function.
fn library(system: &str) -> Vec<u8> {
    let mut bytes = vec![0; 512];
    match system {
        "linux" => {
            bytes[..5].copy_from_slice(&[0x7f, b'E', b'L', b'F', 2]);
            bytes[0x12] = 0x3e;
        }
        "windows" => {
            bytes[..2].copy_from_slice(b"MZ");
            bytes[0x3c] = 0x80;
            bytes[0x80..0x86].copy_from_slice(&[b'P', b'E', 0, 0, 0x64, 0x86]);
        }
        _ => bytes[..8].copy_from_slice(&[0xcf, 0xfa, 0xed, 0xfe, 0x0c, 0, 0, 1]),
    }
    bytes[0x100..0x10a].copy_from_slice(b"fmi3DoStep");
    bytes
}

fn fmu(source: &Source, kind: Kind, version: Version, systems: &[&str]) -> Result<Vec<u8>, String> {
    let world = World::read(source, &[]).unwrap();
    let libraries: Vec<_> = systems.iter().map(|system| (PathBuf::from(system), library(system))).collect();
    write(&world, &parameters(source, &[]).unwrap(), "A < B & \"C\"", kind, version, &libraries)
}

fn file(fmu: &[u8], name: &str) -> String {
    let mut text = String::new();
    ZipArchive::new(Cursor::new(fmu)).unwrap().by_name(name).unwrap().read_to_string(&mut text).unwrap();
    text
}

#[test]
fn the_same_world_gives_the_same_bytes_and_a_library_for_each_platform() {
    let source = Source::from_text("wheel.toml", WHEEL);
    for (version, folders) in [
        (Version::Two, ["linux64", "win64", "darwin64"]),
        (Version::Three, ["x86_64-linux", "x86_64-windows", "aarch64-darwin"]),
    ] {
        let make = || fmu(&source, Kind::Loop, version, &["linux", "windows", "darwin"]).unwrap();
        let made = make();
        assert_eq!(make(), made);
        let archive = ZipArchive::new(Cursor::new(&made)).unwrap();
        let mut names: Vec<String> = archive.file_names().map(|name| name.unwrap().into_owned()).collect();
        let mut expected = vec!["modelDescription.xml".to_string(), "resources/world.toml".into()];
        expected.extend(
            folders.iter().zip(["so", "dll", "dylib"]).map(|(folder, end)| format!("binaries/{folder}/hapt_fmi.{end}")),
        );
        names.sort_unstable();
        expected.sort_unstable();
        assert_eq!(names, expected);
    }
}

#[test]
fn a_world_needs_no_other_file() {
    for name in builtin::names() {
        let source = builtin::source(&name).unwrap();
        let made = fmu(&source, Kind::Whole, Version::Three, &["linux"]).unwrap();
        let text = file(&made, "resources/world.toml");
        assert!(!text.contains("scenarios") && !text.contains("file ="), "{name}: {text}");
        let world = World::read(&source, &[]).unwrap();
        let read = World::read(&Source::from_text("world.toml", text), &[]).unwrap();
        assert_eq!(read, World { scenarios: Vec::new(), ..world }, "{name}");
    }
}

#[test]
fn names_are_escaped_and_units_are_the_files_own() {
    let made = fmu(&Source::from_text("wheel.toml", WHEEL), Kind::Loop, Version::Two, &["linux"]).unwrap();
    let text = file(&made, "modelDescription.xml");
    assert!(text.contains("modelName=\"A &lt; B &amp; &quot;C&quot;\""), "{text}");
    let at = text.find("name=\"couplings.0.stiffness\"").unwrap();
    let variable = &text[at..at + 500];
    assert!(variable.contains("unit=\"N m/rad\" displayUnit=\"N mm/deg\" min=\"0.0\" start=\"1.01"), "{variable}");
    assert!(text.contains("<DefaultExperiment startTime=\"0\" stepSize=\"0.001\"/>"));
}

#[test]
fn what_is_no_library_is_refused() {
    assert!(Platform::of(b"#!/bin/sh").unwrap_err().contains("no library"));
    let mut other = library("linux");
    other[0x100] = b'x';
    assert!(Platform::of(&other).unwrap_err().contains("fmi3DoStep"));
    let mut arm = library("linux");
    arm[0x12] = 0x28;
    assert!(Platform::of(&arm).unwrap_err().contains("processor"));
    for cut in 0..0x100 {
        assert!(Platform::of(&library("windows")[..cut]).is_err());
    }
    let source = Source::from_text("wheel.toml", WHEEL);
    let twice = fmu(&source, Kind::Loop, Version::Two, &["linux", "linux"]).unwrap_err();
    assert!(twice.contains("another library for linux64"), "{twice}");
    assert!(fmu(&source, Kind::Loop, Version::Two, &[]).is_err());
}
