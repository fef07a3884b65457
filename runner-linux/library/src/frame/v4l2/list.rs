//! The cameras of this machine.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use v4l::capability::Flags;
use v4l::framesize::FrameSizeEnum;
use v4l::video::Capture;
use v4l::{Device, FourCC};

use super::{RAW_DRIVERS, capabilities};
use crate::frame::convert::PixelFormat;
use crate::order;

/// Devices, formats and sizes, as text for a person.
pub fn list() -> String {
    let mut text = String::new();
    for path in devices() {
        // Writing to a string cannot fail.
        let _ = describe(&mut text, &path);
    }
    if text.is_empty() {
        text.push_str("no /dev/video* on this machine: plug in a camera, or load its driver\n");
    }
    text
}

/// `/dev/video0` and so on, by their numbers.
fn devices() -> Vec<PathBuf> {
    let number = |path: &Path| path.file_name()?.to_str()?.strip_prefix("video")?.parse::<u32>().ok();
    let entries = fs::read_dir("/dev").into_iter().flatten().flatten();
    let mut devices: Vec<(u32, PathBuf)> =
        entries.filter_map(|entry| Some((number(&entry.path())?, entry.path()))).collect();
    order::sort(&mut devices);
    devices.into_iter().map(|(_, path)| path).collect()
}

/// Links to a device that stay the same when others come and go.
fn links(device: &Path) -> Vec<PathBuf> {
    let folders = ["/dev/v4l/by-id", "/dev/v4l/by-path"];
    let entries = folders.into_iter().flat_map(|folder| fs::read_dir(folder).into_iter().flatten().flatten());
    let leads_here = |path: &PathBuf| fs::canonicalize(path).is_ok_and(|target| target == device);
    let mut links: Vec<PathBuf> = entries.map(|entry| entry.path()).filter(leads_here).collect();
    order::sort(&mut links);
    links
}

fn describe(text: &mut String, path: &Path) -> std::fmt::Result {
    write!(text, "{}", path.display())?;
    let device = match Device::with_path(path) {
        Ok(device) => device,
        Err(error) => return writeln!(text, ": cannot be opened: {error}"),
    };
    let Some(has) = capabilities(&device, path) else { return writeln!(text, ": does not say what it is") };
    writeln!(text, ": {} (driver {}, {})", has.card, has.driver, has.bus)?;
    for link in links(path) {
        writeln!(text, "  {}", link.display())?;
    }
    if RAW_DRIVERS.contains(&has.driver.as_str()) {
        return writeln!(
            text,
            "  raw sensor data: use rpicam-vid and --input -, see daymark watch --camera {}",
            path.display()
        );
    }
    if !has.capabilities.contains(Flags::VIDEO_CAPTURE) {
        return writeln!(text, "  gives no frames (metadata, output, or several planes)");
    }
    let (read, other): (Vec<_>, Vec<_>) = device
        .enum_formats()
        .unwrap_or_default()
        .into_iter()
        .map(|format| format.fourcc)
        .partition(|fourcc| PixelFormat::from_fourcc(fourcc.repr).is_some());
    // The highest bit of the last letter means big-endian.
    let name = |fourcc: &FourCC| String::from_utf8_lossy(&fourcc.repr.map(|letter| letter & 0x7F)).trim().to_owned();
    for fourcc in &read {
        let sizes = device.enum_framesizes(*fourcc).unwrap_or_default();
        let sizes: Vec<String> = sizes.iter().map(|size| size_text(&size.size)).collect();
        writeln!(text, "  {}: {}", name(fourcc), sizes.join(", "))?;
    }
    if !other.is_empty() {
        writeln!(text, "  not read by daymark: {}", other.iter().map(name).collect::<Vec<_>>().join(", "))?;
    }
    Ok(())
}

fn size_text(size: &FrameSizeEnum) -> String {
    match size {
        FrameSizeEnum::Discrete(size) => format!("{}x{}", size.width, size.height),
        FrameSizeEnum::Stepwise(size) => {
            format!("{}x{} to {}x{}", size.min_width, size.min_height, size.max_width, size.max_height)
        }
    }
}
