use crate::recording::{Recording, lightcast, stderr};
use std::fs;

/// Runs with a configuration and expects exit code 2 and these words.
fn refused(text: &str, expected: &[&str]) {
    let recording = Recording::new(1);
    fs::write(recording.configuration(), text).unwrap();
    let output = recording.run();
    let messages = stderr(&output);
    assert_eq!(output.status.code(), Some(2), "{messages}");
    for words in expected.iter().chain(&["run.toml"]) {
        assert!(messages.contains(words), "{words} is not in {messages}");
    }
    assert!(output.stdout.is_empty());
}

const SOURCE: &str = "[source]\nkind = \"sequence\"\npath = \"sky.####.exr\"\n";

#[test]
fn an_unknown_key_is_refused_with_file_line_and_key() {
    refused(&format!("{SOURCE}colour = 3\n"), &["line 4", "unknown field `colour`"]);
    refused(&format!("{SOURCE}[lights]\n\nnumber = 3\n"), &["line 6", "unknown field `number`"]);
    refused(&format!("{SOURCE}[gpu]\n"), &["line 4", "unknown field `gpu`"]);
}

#[test]
fn an_unreadable_key_is_refused_with_file_line_and_key() {
    refused(
        &format!("{SOURCE}frame_rate_hz = \"fast\"\n"),
        &["line 4", "frame_rate_hz", "where a number is wanted"],
    );
    refused(&format!("{SOURCE}pace = \n"), &["line 4", "pace"]);
    refused(&format!("{SOURCE}[map]\nrows = 0\n"), &["line 5", "rows = 0"]);
}

#[test]
fn a_value_that_only_its_algorithm_can_judge_is_refused_with_file_line_and_key() {
    refused(&format!("{SOURCE}[lights]\ncount = 0\n"), &["line 5", "count = 0"]);
    refused(&format!("{SOURCE}[filter]\npass_hz = 7.0\nstop_hz = 2.0\n"), &["line 6", "stop_hz = 2"]);
}

#[test]
fn a_filter_that_this_frame_rate_does_not_allow_is_refused_before_the_first_frame() {
    refused(
        &format!("{SOURCE}frame_rate_hz = 25\n[filter]\ndelay_s = 1000\n"),
        &["line 5: a delay of delay_s = 1000"],
    );
}

#[test]
fn a_map_that_no_memory_holds_is_refused_with_file_and_line() {
    refused(
        &format!("{SOURCE}[map]\ncolumns = 16384\nrows = 16384\n"),
        &["line 5: columns = 16384: with 16384 rows a polar map has more than"],
    );
}

#[test]
fn a_start_that_fails_leaves_the_old_output_file_alone() {
    let recording = Recording::new(0);
    let old = recording.path().join("lights.jsonl");
    fs::write(&old, "an hour of lists").unwrap();
    let output = recording.command().arg("--output").arg(&old).output().unwrap();
    assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
    assert_eq!(fs::read_to_string(&old).unwrap(), "an hour of lists");
}

#[test]
fn messages_that_nobody_can_receive_do_not_change_the_exit_code() {
    let full = fs::File::options().write(true).open("/dev/full").unwrap();
    let status = lightcast().args(["run", "--config", "/nowhere/at/all.toml"]).stderr(full).status().unwrap();
    assert_eq!(status.code(), Some(2));
}

#[test]
fn a_configuration_that_is_missing_is_named() {
    let output = lightcast().args(["run", "--config", "/nowhere/at/all.toml"]).output().unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("/nowhere/at/all.toml"));
}

#[test]
fn a_calibration_that_is_missing_is_named() {
    let recording = Recording::new(1);
    let camera = "[camera]\nprojection = \"fisheye\"\ncalibration = \"lens.json\"\n";
    fs::write(recording.configuration(), format!("{SOURCE}{camera}")).unwrap();
    let output = recording.run();
    assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
    assert!(stderr(&output).contains("lens.json"), "{}", stderr(&output));
}

#[test]
fn wrong_usage_exits_with_2_and_help_with_0() {
    for (arguments, code) in
        [(&["run"][..], 2), (&["walk"], 2), (&[], 2), (&["--help"], 0), (&["run", "--help"], 0)]
    {
        assert_eq!(lightcast().args(arguments).output().unwrap().status.code(), Some(code), "{arguments:?}");
    }
}
