//! The forms of `daymark watch`: JSON by its schema, NMEA as another program reads it, GeoJSON, text, and what a pipe gives.

mod support;

use std::net::UdpSocket;
use std::time::Duration;

use nmea::{Nmea, ParseResult, parse_str};
use serde_json::Value;
use support::{Town, fixture};

/// The Gate with a place, seen for two seconds, then nothing.
fn town() -> Town {
    let town = Town::new();
    town.tower(1, "left", "gate.pgm");
    let place = ["--at", "52.5,-13.25", "--position-error", "20"];
    let enroll = ["enroll", "--table", "town.daymark", "--name", "Gate, old*", "--no-lint", "gate.pgm"];
    town.run(&[&enroll[..], &place].concat()).succeeded();
    std::fs::create_dir(town.path("frames")).expect("a folder");
    for number in 0..20 {
        std::fs::copy(fixture("tower-1-left.pgm"), town.path(&format!("frames/{number:03}.pgm"))).expect("a frame");
    }
    for number in 20..30 {
        town.draw(&format!("frames/{number:03}.pgm"), 320, 240, |x, y| support::speckle(x / 3, y / 3, number));
    }
    town
}

fn watch(town: &Town, more: &[&str]) -> support::Ran {
    town.run(&[&["watch", "--table", "town.daymark", "--frames", "frames"], more].concat())
}

#[test]
fn every_line_of_json_is_as_the_schema_says() {
    let schema = include_str!("../docs/watch.schema.json");
    let schema: Value = serde_json::from_str(schema).expect("the schema is JSON");
    let validator = jsonschema::validator_for(&schema).expect("the schema is a schema");
    let town = town();
    town.draw("frames/030.pgm", 320, 240, |_, _| 3);
    let faults = ["no-frame", "short", "corrupt", "wrong-size", "again", "io", "busy", "unplugged", "clock-back"];
    let faults: Vec<String> = (4..).zip(faults).map(|(at, fault)| format!("--rehearse={at}:{fault}")).collect();
    let arguments: Vec<&str> = ["--json", "--stats"].into_iter().chain(faults.iter().map(String::as_str)).collect();
    let ran = watch(&town, &arguments).succeeded();
    let mut kinds = std::collections::BTreeSet::new();
    for line in ran.stdout.lines() {
        let value: Value = serde_json::from_str(line).expect("JSON");
        let faults: Vec<String> = validator.iter_errors(&value).map(|error| error.to_string()).collect();
        assert!(faults.is_empty(), "{line}\n{faults:#?}");
        kinds.insert(value["type"].as_str().expect("a type").to_owned());
    }
    let expected = ["answer", "camera", "counters", "end", "frame", "start", "withdrawn"];
    assert!(kinds.iter().map(String::as_str).eq(expected), "{kinds:?}");
    // The schema is not one that takes anything.
    for wrong in
        [r#"{"schema_version":2,"type":"end","reason":"stopped","error":null}"#, r#"{"schema_version":1,"type":"end"}"#]
    {
        assert!(!validator.is_valid(&serde_json::from_str(wrong).expect("JSON")), "{wrong}");
    }
}

#[test]
fn nmea_is_read_back_as_an_estimate_and_never_as_a_satellite_fix() {
    let town = town();
    let ran = watch(&town, &["--output", "nmea:-", "--reach", "180"]).succeeded();
    let sentences: Vec<&str> = ran.stdout.lines().map(str::trim_end).collect();
    assert!(ran.stdout.split_inclusive('\n').all(|line| line.ends_with("\r\n") && line.len() <= 82), "{sentences:#?}");
    let kinds: Vec<&str> = sentences.iter().map(|line| &line[1..6]).collect();
    // Given at once, repeated after a second, withdrawn.
    let seen = ["INGGA", "INRMC", "INGST", "INTLL"];
    assert_eq!(kinds, [&seen[..], &seen, &["INGGA", "INRMC", "INTLL"]].concat());
    for line in &sentences {
        assert!(!line.starts_with("$INGGA") || !line.contains(",E,1,") && !line.contains(",W,1,"), "{line}");
    }
    let ParseResult::GGA(gga) = parse_str(sentences[0]).expect("GGA") else { panic!("{}", sentences[0]) };
    assert_eq!(gga.fix_type, Some(nmea::sentences::FixType::Estimated));
    let close = |found: Option<f64>, expected: f64| found.is_some_and(|found| (found - expected).abs() < 1e-7);
    assert!(close(gga.latitude, 52.5) && close(gga.longitude, -13.25), "{gga:?}");
    let ParseResult::RMC(rmc) = parse_str(sentences[1]).expect("RMC") else { panic!("{}", sentences[1]) };
    assert!(close(rmc.lat, 52.5) && close(rmc.lon, -13.25), "{rmc:?}");
    assert!(sentences[1].contains(",A,") && sentences[1].contains(",E*"), "{}", sentences[1]);
    let ParseResult::GST(gst) = parse_str(sentences[2]).expect("GST") else { panic!("{}", sentences[2]) };
    // Half of 180 m of reach and half of the 20 m of the building's place, in squares, along each axis.
    assert_eq!((gst.lat_sd, gst.long_sd), (Some(90.6), Some(90.6)), "{gst:?}");
    assert!(sentences[3].starts_with("$INTLL,00,5230.000000,N,01315.000000,W,Gate  old ,,T,*"), "{}", sentences[3]);
    let ParseResult::GGA(gone) = parse_str(sentences[8]).expect("GGA") else { panic!("{}", sentences[8]) };
    assert_eq!((gone.fix_type, gone.latitude), (Some(nmea::sentences::FixType::Invalid), None));
    assert!(sentences[9].starts_with("$INRMC,,V,") && sentences[10].contains(",L,*"), "{}", sentences[9]);
    // A whole receiver takes them one after the other, and knows nothing any more in the end.
    let mut receiver = Nmea::default();
    for line in sentences.iter().filter(|line| line.contains("GGA") || line.contains("RMC")) {
        receiver.parse(line).expect("a sentence");
    }
    assert_eq!((receiver.latitude, receiver.fix_type), (None, Some(nmea::sentences::FixType::Invalid)));
}

#[test]
fn nmea_goes_out_by_udp_a_sentence_a_datagram_with_the_time_of_day() {
    let town = town();
    let socket = UdpSocket::bind("127.0.0.1:0").expect("a port");
    socket.set_read_timeout(Some(Duration::from_secs(20))).expect("a time-out");
    let target = format!("nmea:udp://{}", socket.local_addr().expect("an address"));
    watch(&town, &["--real-time", "--rate", "20", "--output", &target, "--output", "text:-"]).succeeded();
    let mut buffer = [0; 200];
    let length = socket.recv(&mut buffer).expect("a datagram");
    let first = std::str::from_utf8(&buffer[..length]).expect("text");
    let ParseResult::GGA(gga) = parse_str(first.trim_end()).expect("GGA") else { panic!("{first}") };
    assert!(gga.fix_time.is_some(), "{first}");
}

#[test]
fn geojson_and_text_go_to_files_at_once() {
    let town = town();
    watch(&town, &["--output", "geojson:map.geojsonl", "--output", "text:told.txt", "--output", "jsonl:all.jsonl"])
        .succeeded();
    let map = String::from_utf8(town.read("map.geojsonl")).expect("text");
    let features: Vec<Value> = map.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    assert_eq!(features.len(), 2);
    assert_eq!(features[0]["geometry"]["coordinates"], serde_json::json!([-13.25, 52.5]), "longitude first");
    assert_eq!(features[0]["properties"]["method"], "near_landmark");
    let told = String::from_utf8(town.read("told.txt")).expect("text");
    assert!(told.contains("00:00:00.00  Gate, old* (building): false with a probability of"), "{told}");
    assert!(told.contains("it stands at 52.500000, -13.250000") && told.contains("not seen any more"), "{told}");
    assert!(!town.read("all.jsonl").is_empty());
}

#[test]
fn pictures_that_are_good_for_nothing_are_named() {
    let town = town();
    let edge = |x: u32| if (x / 40).is_multiple_of(2) { 60.0 } else { 190.0 };
    let blurred = |x: u32, _: u32| ((0..24).map(|d| edge(x + d)).sum::<f64>() / 24.0) as u8;
    town.draw("frames/030.pgm", 320, 240, |x, _| (x % 7) as u8);
    town.draw("frames/031.pgm", 320, 240, |_, _| 254);
    town.draw("frames/032.pgm", 320, 240, |x, _| 128 + (x % 2) as u8);
    town.draw("frames/033.pgm", 320, 240, blurred);
    let ran = watch(&town, &["--output", "text:-"]).succeeded();
    for said in [
        "the picture is too dark",
        "blown out: a shorter exposure",
        "the picture is empty: see",
        "blurred: clean and focus",
    ] {
        assert!(ran.stdout.contains(said), "{said}: {}", ran.stdout);
    }
    let ran = watch(&town, &["--json"]).succeeded();
    let qualities: Vec<Value> =
        ran.stdout.lines().map(|line| serde_json::from_str::<Value>(line).expect("JSON")["quality"].clone()).collect();
    let named: Vec<&str> = qualities.iter().filter_map(Value::as_str).collect();
    assert!(named[..30].iter().all(|quality| *quality == "good"), "{named:?}");
    assert_eq!(named[30..], ["dark", "blown_out", "empty", "blurred"]);
}

#[test]
fn the_same_frames_give_the_same_answers_from_every_kind_of_input() {
    let town = town();
    let pictures: Vec<Vec<u8>> = (0..30)
        .map(|number| {
            let file = town.read(&format!("frames/{number:03}.pgm"));
            file[file.len() - 320 * 240..].to_vec()
        })
        .collect();
    let rows = |stride: usize, tail: usize| -> Vec<u8> {
        let padded = |row: &[u8]| [row, &vec![0; stride - 320]].concat();
        let frame = |picture: &Vec<u8>| [picture.chunks(320).flat_map(padded).collect(), vec![128; tail]].concat();
        pictures.iter().flat_map(frame).collect()
    };
    town.write("y8.raw", rows(320, 0));
    town.write("padded.raw", rows(384, 384 * 120));
    let y4m = |picture: &Vec<u8>| [b"FRAME\n".as_slice(), picture, &[128; 320 * 120]].concat();
    town.write(
        "video.y4m",
        [b"YUV4MPEG2 W320 H240 F10:1 C420jpeg\n".to_vec(), pictures.iter().flat_map(y4m).collect()].concat(),
    );
    let answers = |arguments: &[&str]| -> Vec<Value> {
        let ran = town.run(&[&["watch", "--table", "town.daymark", "--json"], arguments].concat()).succeeded();
        let lines = ran.stdout.lines().map(|line| serde_json::from_str::<Value>(line).expect("JSON"));
        lines.filter(|line| line["type"] == "answer" || line["type"] == "withdrawn").collect()
    };
    let size = ["--width", "320", "--height", "240"];
    let expected = answers(&["--frames", "frames"]);
    assert_eq!(expected.len(), 3);
    assert_eq!(answers(&[&["--input", "y8.raw", "--format", "y8"], &size[..]].concat()), expected);
    assert_eq!(
        answers(&[&["--input", "padded.raw", "--format", "yu12", "--stride", "384"], &size[..]].concat()),
        expected
    );
    assert_eq!(answers(&["--input", "video.y4m", "--format", "y4m"]), expected);

    // A stream that ends within a frame.
    let whole = town.read("y8.raw");
    town.write("cut.raw", &whole[..whole.len() - 1_000]);
    let ran =
        town.run(&[&["watch", "--table", "town.daymark", "--input", "cut.raw", "--format", "y8"], &size[..]].concat());
    assert!(ran.succeeded().stderr.contains("a frame of 75800 bytes instead of 76800"));
}

#[test]
fn what_cannot_work_is_refused_before_anything_runs() {
    let town = town();
    let watch = |more: &[&str]| town.run(&[&["watch", "--table", "town.daymark"], more].concat());
    watch(&["--frames", "nowhere"]).refused(&["cannot read the frames in nowhere"]);
    watch(&["--input", "-"]).refused(&["--format yu12 --width 640"]);
    watch(&["--input", "gate.pgm", "--format", "mjpg"]).refused(&["y4m"]);
    watch(&["--frames", "frames", "--output", "nmea:udp://nowhere"]).refused_by_the_parser("has no port");
    watch(&["--frames", "frames", "--output", "text:-", "--json"]).refused(&["only one form"]);
    watch(&["--frames", "frames", "--output", "text:no/folder/x"]).refused(&["cannot write to no/folder/x"]);
    watch(&["--frames", "frames", "--rehearse", "1:fire"]).refused_by_the_parser("the faults are no-frame, short");
    watch(&["--frames", "frames", "--camera", "/dev/video0"]).refused_by_the_parser("cannot be used with");
    let nothing = ["watch", "--table", "town.daymark", "--frames", "only"];
    std::fs::create_dir(town.path("only")).expect("a folder");
    town.draw("only/1.pgm", 320, 240, |x, y| support::speckle(x, y, 1));
    assert_eq!(town.run(&nothing).code, Some(1), "no answer");
}
