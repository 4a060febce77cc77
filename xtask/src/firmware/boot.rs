//! The data with which the bootrom of an RP2350 starts a program: the image's definition in the flash (datasheet, 5.9), or a file in UF2
//! that it takes as a USB drive.

use std::fs;
use std::path::Path;
use std::process::Command;

use anyhow::{Context, Result, ensure};

use super::program;

/// Raspberry Pi Pico 2.
pub const BOARD: &str = "pico2";

const FLASH: u32 = 0x1000_0000;
/// Where the definition may stand.
const SEARCHED: usize = 4096;
const START: u32 = 0xffff_ded3;
const END: u32 = 0xab12_3579;
/// The items of a block: the image's type, and the last one.
const TYPE: u32 = 0x42;
const LAST: u32 = 0xff;
/// Executable, secure, for ARM, of an RP2350.
const ARM_SECURE: u32 = 0x1021;
/// UF2's words at the beginning and the end of a block, and the flag that the family is in it.
const UF2: [u32; 3] = [0x0a32_4655, 0x9e5d_5157, 0x0ab1_6f30];
const HAS_FAMILY: u32 = 0x2000;
/// The family of these programs in UF2.
const FAMILY: u32 = 0xe48b_ff59;
/// Bytes of the flash in a block of UF2.
const PIECE: usize = 256;

/// The program's bytes in the flash, from its beginning.
fn image(program: &Path) -> Result<Vec<u8>> {
    let bytes = program.with_extension("flash");
    let output = Command::new("arm-none-eabi-objcopy").args(["-O", "binary"]).arg(program).arg(&bytes).output()?;
    ensure!(output.status.success(), "arm-none-eabi-objcopy: {}", String::from_utf8_lossy(&output.stderr));
    Ok(fs::read(bytes)?)
}

/// The bootrom finds one definition, of a program for this processor whose vectors lead into the flash and to the end of its memory.
pub fn holds() -> Result<()> {
    let image = image(&program(BOARD, "wheel", None)?)?;
    let words: Vec<u32> =
        image.chunks_exact(4).map(|word| u32::from_le_bytes([word[0], word[1], word[2], word[3]])).collect();
    starts(&words, image.len())?;
    // Each of these words counts.
    let at = words.iter().position(|word| *word == START).context("no definition")?;
    for changed in [0, 1, at, at + 1, at + 2, at + 3, at + 4] {
        let mut words = words.clone();
        words[changed] ^= 0x0101_0101;
        ensure!(starts(&words, image.len()).is_err(), "a changed word {changed} is not seen");
    }
    println!("        {BOARD}: the image's definition at {:#x}, {} bytes of flash", 4 * at, image.len());
    Ok(())
}

fn starts(words: &[u32], length: usize) -> Result<()> {
    let [stack, reset, ..] = *words else { anyhow::bail!("no vectors") };
    ensure!(stack == 0x2008_0000, "a stack from {stack:#x}");
    ensure!(reset % 2 == 1 && (FLASH..FLASH + length as u32).contains(&reset), "it begins at {reset:#x}");
    let searched = &words[..words.len().min(SEARCHED / 4)];
    let at = searched.iter().position(|word| *word == START).context("no definition in the flash's first 4 KiB")?;
    let mut items = searched[at + 1..].iter().copied();
    // Each begins with its kind and its length in words, itself included.
    let (mut total, mut image_type) = (0, None);
    loop {
        let item = items.next().context("the block has no end")?;
        let kind = item & 0xff;
        if kind == LAST {
            ensure!(item >> 8 == total, "the last item counts {} words of {total}", item >> 8);
            break;
        }
        ensure!(kind == TYPE && item >> 8 & 0xff == 1, "an item {item:#x}");
        (total, image_type) = (total + 1, Some(item >> 16));
    }
    ensure!(image_type == Some(ARM_SECURE), "an image of the type {image_type:x?}");
    // The offset of the next block: there is none.
    ensure!(items.next() == Some(0) && items.next() == Some(END), "the block does not end");
    Ok(())
}

/// The wheel's program as UF2.
pub fn write(file: &Path) -> Result<()> {
    let blocks = uf2(image(&program(BOARD, "wheel", None)?)?);
    fs::write(file, blocks).with_context(|| file.display().to_string())
}

/// Blocks of 512 bytes, each with 256 of the flash (github.com/microsoft/uf2).
fn uf2(mut image: Vec<u8>) -> Vec<u8> {
    image.resize(image.len().next_multiple_of(PIECE), 0);
    let count = (image.len() / PIECE) as u32;
    let mut blocks = Vec::new();
    for (number, piece) in (0..).zip(image.chunks_exact(PIECE)) {
        let address = FLASH + number * PIECE as u32;
        let head = [UF2[0], UF2[1], HAS_FAMILY, address, PIECE as u32, number, count, FAMILY];
        let end = blocks.len() + 508;
        blocks.extend(head.iter().flat_map(|word| word.to_le_bytes()));
        blocks.extend(piece);
        blocks.resize(end, 0);
        blocks.extend(UF2[2].to_le_bytes());
    }
    blocks
}
