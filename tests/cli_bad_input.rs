//! Whatever is wrong with the input: a clear message with what to do, exit 2, and nothing lost.

mod support;

use std::fs;
use std::io::Cursor;
use std::process::Command;

use image::{DynamicImage, ImageBuffer, ImageFormat, Luma};
use support::{Ran, Town, fixture, speckle};

/// Enrolls `picture` into a table with two landmarks; it must be refused, and the table stay as it was.
#[track_caller]
fn refused_for_a_table(town: &Town, picture: &str, expected: &[&str]) {
    let (before, names) = (town.read("town.daymark"), town.names());
    let ran = town.run(&["enroll", "--table", "town.daymark", "--name", "New", "mill.pgm", picture]);
    ran.refused(&[picture, "Nothing was enrolled"]).refused_too(expected);
    assert_eq!(town.read("town.daymark"), before, "the old table is untouched");
    assert_eq!(town.names(), names, "nothing is left behind");
}

/// The same, and as a frame.
#[track_caller]
fn refused_picture(town: &Town, picture: &str, expected: &[&str]) {
    refused_for_a_table(town, picture, expected);
    let ran = town.run(&["recognize", "--table", "town.daymark", picture]);
    assert_eq!((ran.code, ran.stdout.as_str()), (Some(2), ""), "{ran:#?}");
    assert!(expected.iter().all(|expected| ran.stderr.contains(expected)), "{ran:#?}");
}

impl Ran {
    #[track_caller]
    fn refused_too(self, expected: &[&str]) {
        self.refused(expected);
    }
}

/// Enrolls `picture` and finds the building in a frame.
#[track_caller]
fn works(town: &Town, picture: &str) {
    town.run(&["enroll", "--table", "new.daymark", "--name", "New", "--no-lint", picture]).succeeded();
    let ran = town.run(&["recognize", "--table", "new.daymark", picture]).succeeded();
    assert!(ran.stdout.contains("New"), "{ran:#?}");
    fs::remove_file(town.path("new.daymark")).expect("a table");
}

fn encoded(picture: &DynamicImage, format: ImageFormat) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    picture.write_to(&mut bytes, format).expect("encoded");
    bytes.into_inner()
}

/// A chunk of a PNG file.
fn chunk(kind: [u8; 4], data: &[u8]) -> Vec<u8> {
    let length = u32::try_from(data.len()).expect("short");
    let checked = [kind.as_slice(), data].concat();
    let crc = checked.iter().fold(!0_u32, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |crc, _| if crc & 1 == 1 { crc >> 1 ^ 0xEDB8_8320 } else { crc >> 1 })
    });
    [&length.to_be_bytes(), checked.as_slice(), &(!crc).to_be_bytes()].concat()
}

#[test]
fn a_picture_that_cannot_be_read_is_refused_with_what_to_do() {
    let town = Town::with_table();
    let tower = image::open(town.path("gate.pgm")).expect("a picture");

    for (name, format) in [("cut.png", ImageFormat::Png), ("cut.pgm", ImageFormat::Pnm)] {
        let bytes = encoded(&tower, format);
        town.write(name, &bytes[..bytes.len() / 3]);
        refused_picture(&town, name, &["is damaged", "save it again as JPEG or PNG"]);
    }
    let bytes = encoded(&tower, ImageFormat::Jpeg);
    town.write("cut.jpg", &bytes[..bytes.len() / 3]);
    refused_picture(&town, "cut.jpg", &["is damaged", "its end is missing", "save it again as JPEG or PNG"]);
    town.write("header.png", &encoded(&tower, ImageFormat::Png)[..20]);
    refused_picture(&town, "header.png", &["is damaged"]);
    town.write("empty.jpg", "");
    refused_picture(&town, "empty.jpg", &["zero bytes", "copy or take it again"]);
    town.draw("dot.png", 1, 1, |_, _| 128);
    refused_picture(&town, "dot.png", &["only 1 x 1 pixels", "at least 64"]);
    town.write("letter.jpg", "Dear navigator,\nthis is no picture.\n");
    refused_picture(&town, "letter.jpg", &["is not a picture", "use JPEG, PNG"]);
    fs::create_dir(town.path("album")).expect("a folder");
    refused_picture(&town, "album", &["is a folder, not a picture", "name the pictures in it"]);
    refused_picture(&town, "missing.jpg", &["cannot read the picture missing.jpg", "No such file"]);
}

#[test]
fn a_picture_that_claims_to_be_huge_is_refused_before_memory_is_taken() {
    let town = Town::with_table();
    let side = 30_000_u32.to_be_bytes();
    // Gray of 8 bits; the pixels are missing, and nobody must look for them.
    let header = [side.as_slice(), &side, &[8, 0, 0, 0, 0]].concat();
    let png =
        [b"\x89PNG\r\n\x1a\n".as_slice(), &chunk(*b"IHDR", &header), &chunk(*b"IDAT", &[]), &chunk(*b"IEND", &[])];
    town.write("huge.png", png.concat());
    refused_picture(&town, "huge.png", &["30000 x 30000 pixels", "scale it down"]);
    // 256 MB of address space are not enough for 900 million pixels.
    let shell = format!("ulimit -v 262144; exec '{}' \"$@\"", env!("CARGO_BIN_EXE_daymark"));
    let mut command = Command::new("sh");
    command.current_dir(town.path("")).args(["-c", &shell, "sh", "recognize", "--table", "town.daymark", "huge.png"]);
    let ran = Ran::of(command.output());
    assert_eq!(ran.code, Some(2), "{ran:#?}");
    assert!(ran.stderr.contains("30000 x 30000 pixels"), "{ran:#?}");
}

#[test]
fn pictures_of_16_bits_and_of_four_inks_work() {
    let town = Town::new();
    let tower = image::open(fixture("tower-1-left.pgm")).expect("a picture").into_luma8();
    let deep = ImageBuffer::<Luma<u16>, _>::from_fn(tower.width(), tower.height(), |x, y| {
        Luma([u16::from(tower.get_pixel(x, y).0[0]) * 257 - u16::from(tower.get_pixel(x, y).0[0] > 0)])
    });
    town.write("deep.png", encoded(&DynamicImage::ImageLuma16(deep), ImageFormat::Png));
    works(&town, "deep.png");
    // The same tower, written with four inks by another program.
    town.write("inks.jpg", include_bytes!("support/cmyk.jpg"));
    works(&town, "inks.jpg");
    // They show what the gray picture shows.
    town.tower(1, "left", "gate.pgm");
    town.run(&["enroll", "--table", "t.daymark", "--name", "Gate", "--no-lint", "gate.pgm"]).succeeded();
    for picture in ["deep.png", "inks.jpg"] {
        town.run(&["recognize", "--table", "t.daymark", picture]).succeeded();
    }
}

#[test]
fn a_picture_with_too_few_corners_is_refused_for_a_table_and_an_answer_for_a_frame() {
    let town = Town::with_table();
    town.draw("fog.png", 320, 240, |x, _| 120 + (x / 32) as u8);
    let before = town.read("town.daymark");
    let ran = town.run(&["enroll", "--table", "town.daymark", "--name", "Fog", "fog.png"]);
    ran.refused(&["fog.png cannot be enrolled", "only 0 corners", "take a sharp picture", "Nothing was enrolled"]);
    assert_eq!(town.read("town.daymark"), before);
    let ran = town.run(&["recognize", "--table", "town.daymark", "fog.png"]);
    assert_eq!(ran.code, Some(1), "{ran:#?}");
    assert!(ran.stdout.contains("corners"), "{ran:#?}");
    assert_eq!(ran.stderr, "");
}

/// Every command that reads a table refuses this one, and leaves it as it is.
#[track_caller]
fn refused_table(town: &Town, name: &str, expected: &[&str]) {
    let before = fs::read(town.path(name)).ok();
    let commands: [&[&str]; 7] = [
        &["enroll", "--table", name, "--name", "New", "mill.pgm"],
        &["recognize", "--table", name, "mill.pgm"],
        &["table", "list", name],
        &["table", "show", name, "Gate"],
        &["table", "verify", name],
        &["table", "merge", name, "town.daymark", name],
        &["table", "remove", name, "Gate"],
    ];
    for command in commands {
        let ran = town.run(command);
        ran.refused(&[name]).refused_too(expected);
        assert_eq!(fs::read(town.path(name)).ok(), before, "{command:?} changed the table");
    }
}

#[test]
fn a_table_that_is_no_sound_table_is_refused_and_kept() {
    let town = Town::with_table();
    let sound = town.read("town.daymark");
    let names = town.names().len();

    town.write("cut.daymark", &sound[..sound.len() - 1]);
    refused_table(&town, "cut.daymark", &["cut short", "restore the table from a copy"]);
    town.write("stub.daymark", &sound[..20]);
    refused_table(&town, "stub.daymark", &["cut short", "20 of 40 bytes"]);
    town.write("long.daymark", [sound.as_slice(), b"\n"].concat());
    refused_table(&town, "long.daymark", &["ends after"]);
    town.write("empty.daymark", "");
    refused_table(&town, "empty.daymark", &["empty"]);
    town.write("other.daymark", "# Our town\n\nIt has a gate and a mill and is not a landmark table.\n");
    refused_table(&town, "other.daymark", &["not a landmark table"]);
    fs::create_dir(town.path("folder.daymark")).expect("a folder");
    refused_table(&town, "folder.daymark", &["directory", "give the path of the table in the folder"]);
    assert_eq!(town.names().len(), names + 6, "nothing temporary is left behind");
}

#[test]
fn one_flipped_bit_anywhere_is_found() {
    let town = Town::with_table();
    let sound = town.read("town.daymark");
    // In the magic, the header, the index, a name, and in the views.
    for place in [3, 13, 20, 33, 45, 80, 120, 1_000, sound.len() - 1] {
        let mut flipped = sound.clone();
        flipped[place] ^= 0x10;
        town.write("flipped.daymark", &flipped);
        let ran = town.run(&["table", "verify", "flipped.daymark"]);
        ran.refused(&["flipped.daymark is not sound: "]);
        let ran = town.run(&["enroll", "--table", "flipped.daymark", "--name", "New", "mill.pgm"]);
        ran.refused(&["flipped.daymark"]);
        assert_eq!(town.read("flipped.daymark"), flipped);
    }
    let mut flipped = sound;
    *flipped.last_mut().expect("a byte") ^= 1;
    town.write("flipped.daymark", &flipped);
    refused_table(&town, "flipped.daymark", &["view 1 is damaged", "restore the table from a copy"]);
    let ran = town.run(&["table", "verify", "flipped.daymark", "--json"]);
    assert_eq!(ran.code, Some(2), "{ran:#?}");
    let document = ran.json();
    assert_eq!((&document["sound"], &document["file"]), (&false.into(), &"flipped.daymark".into()));
    assert_eq!(document["table"]["views"], 2, "the header is sound and is told");
    let fault = document["faults"][0].as_str().expect("a fault");
    assert!(fault.contains("landmark \"Mill\": view 1 is damaged"), "{fault}");
}

#[test]
fn a_table_of_a_newer_version_is_refused_by_name() {
    let town = Town::with_table();
    let mut newer = town.read("town.daymark");
    newer[8] = 9;
    // The header's own checksum stands in its last four bytes; it is that of zlib, as in a PNG chunk.
    let crc = chunk(newer[..4].try_into().expect("4 bytes"), &newer[4..36]);
    let crc: [u8; 4] = crc[crc.len() - 4..].try_into().expect("4 bytes");
    newer[36..40].copy_from_slice(&u32::from_be_bytes(crc).to_le_bytes());
    town.write("newer.daymark", &newer);
    refused_table(&town, "newer.daymark", &["version 9", "update"]);
}

#[test]
fn a_missing_table_is_refused_where_one_is_needed() {
    let town = Town::with_table();
    for command in [
        ["recognize", "--table", "missing.daymark", "mill.pgm"].as_slice(),
        &["table", "list", "missing.daymark"],
        &["table", "verify", "missing.daymark"],
        &["table", "merge", "all.daymark", "town.daymark", "missing.daymark"],
    ] {
        town.run(command).refused(&["cannot read missing.daymark", "enroll a landmark first"]);
    }
    assert!(!town.path("missing.daymark").exists());
}

#[test]
fn a_folder_that_cannot_be_written_to_is_refused() {
    let town = Town::with_table();
    let enroll = |table: &str| town.run(&["enroll", "--table", table, "--name", "New", "mill.pgm"]);
    enroll("nowhere/town.daymark").refused(&["cannot write nowhere/town.daymark", "make the folder first"]);
    enroll("mill.pgm/town.daymark").refused(&["mill.pgm/town.daymark"]);
    // Nobody may make files there, not even the superuser, to whom permissions do not apply.
    enroll("/sys/town.daymark").refused(&["cannot write /sys/town.daymark", "the folder must be writable"]);
    town.run(&["table", "merge", "/sys/town.daymark", "town.daymark"]).refused(&["the folder must be writable"]);
    // A device has the name: renaming would replace it.
    enroll("/dev/full").refused(&["/dev/full"]);
    let ran = town.run(&["table", "merge", "--force", "/dev/full", "town.daymark"]);
    ran.refused(&["cannot write /dev/full", "give the path of a file"]);
}

#[test]
fn a_disk_that_takes_no_more_leaves_the_old_table() {
    let town = Town::with_table();
    let (before, names) = (town.read("town.daymark"), town.names());
    // A file system that refuses the second block of a file: the limit for files, without the signal that would end
    // the process. The new table has four.
    let shell = format!("trap '' XFSZ; ulimit -f 2; exec '{}' \"$@\"", env!("CARGO_BIN_EXE_daymark"));
    let limited = |arguments: &[&str]| {
        let mut command = Command::new("sh");
        Ran::of(command.current_dir(town.path("")).args(["-c", &shell, "sh"]).args(arguments).output())
    };
    let told = ["cannot write town.daymark", "A table that was there is unchanged"];
    limited(&["enroll", "--table", "town.daymark", "--name", "New", "mill.pgm"]).refused(&told);
    limited(&["table", "merge", "town.daymark", "town.daymark"]).refused(&told);
    let ran = limited(&["enroll", "--table", "new.daymark", "--name", "New", "mill.pgm", "gate.pgm"]);
    ran.refused(&["cannot write new.daymark"]);
    assert_eq!(town.read("town.daymark"), before);
    assert_eq!(town.names(), names, "neither half a table nor a temporary file");
}

#[test]
fn a_manifest_that_is_wrong_is_refused_with_its_line() {
    let town = Town::with_table();
    let (before, names) = (town.read("town.daymark"), town.names().len());
    let refused = |manifest: &str, expected: &[&str]| {
        town.write("m.toml", manifest);
        let ran = town.run(&["enroll", "--table", "town.daymark", "--manifest", "m.toml"]);
        ran.refused(&["m.toml", "Nothing was enrolled"]).refused_too(expected);
    };
    let entry = |name: &str, image: &str| format!("[[building]]\nname = \"{name}\"\nimages = [\"{image}\"]\n");

    let twice = entry("Hall", "gate.pgm") + &entry("Hall", "mill.pgm");
    refused(&twice, &["line 5", "\"Hall\" is in line 2 already", "rename one"]);
    refused("[[building]]\nname = \"Hall\"\n", &["line 1", "missing field `images`"]);
    refused("[[building]]\nimages = [\"gate.pgm\"]\n", &["missing field `name`"]);
    refused(&(entry("Hall", "gate.pgm") + "at = [52.5]\n"), &["line 4", "invalid length 1"]);
    refused(&(entry("Hall", "gate.pgm") + "at = [152.5, 1]\n"), &["line 4", "latitude 152.5", "latitude comes first"]);
    refused(&(entry("Hall", "gate.pgm") + "kind = \"hall\"\n"), &["line 4", "no kind \"hall\"", "church"]);
    refused(&(entry("Hall", "gate.pgm") + "picture = 1\n"), &["line 4", "unknown field `picture`"]);
    refused(&entry("", "gate.pgm"), &["line 2", "name"]);
    refused("", &["names no building", "[[building]]"]);
    refused("[[building]\n", &["line 1"]);

    // Pictures are told with the entry that names them, all of them at once.
    let two = entry("Hall", "mill.pgm") + &entry("Inn", "inn.jpg") + &entry("Bank", "bank.jpg");
    refused(&two, &["2 of 3 pictures", "m.toml, line 5, building \"Inn\": cannot read the picture inn.jpg", "line 8"]);
    town.write("inn.jpg", "not a picture");
    refused(&(entry("Hall", "mill.pgm") + &entry("Inn", "inn.jpg")), &["line 5, building \"Inn\": inn.jpg is not a"]);

    let ran = town.run(&["enroll", "--table", "town.daymark", "--manifest", "missing.toml"]);
    ran.refused(&["the manifest missing.toml: it cannot be read"]);
    town.run(&["enroll", "--table", "town.daymark", "--manifest", "."]).refused(&["it is a folder"]);
    assert_eq!(town.read("town.daymark"), before);
    assert_eq!(town.names().len(), names + 2, "m.toml and inn.jpg");
}

#[test]
fn a_name_that_no_table_holds_is_refused() {
    let town = Town::with_table();
    let before = town.read("town.daymark");
    for name in ["", "a\nb", &"x".repeat(65)] {
        let ran = town.run(&["enroll", "--table", "town.daymark", "--name", name, "mill.pgm"]);
        ran.refused(&["give another name"]);
    }
    let enroll = ["enroll", "--table", "town.daymark", "--name", "New", "mill.pgm"];
    for (flags, expected) in [
        (["--at", "91,0"], "latitude"),
        (["--at", "nowhere"], "write degrees north and east"),
        (["--kind", "hall"], "possible values"),
        (["--jobs", "0"], "--jobs"),
    ] {
        let ran = town.run(&[enroll.as_slice(), &flags].concat());
        ran.refused(&[expected]);
    }
    assert_eq!(town.read("town.daymark"), before);
}

#[test]
fn a_picture_of_nothing_but_noise_is_an_answer() {
    let town = Town::with_table();
    town.draw("snow.png", 320, 240, |x, y| speckle(x, y, 1));
    let ran = town.run(&["recognize", "--table", "town.daymark", "snow.png"]);
    assert_eq!(ran.code, Some(1), "{ran:#?}");
}
