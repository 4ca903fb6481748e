//! `kagome machines` and `kagome materials`: a profile of one's own is made, checked and used by name of its file.

#![allow(clippy::unwrap_used, reason = "a helper that fails, fails its test")]

use std::path::Path;
use std::process::{Command, Output};

fn kagome(folder: &Path, args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_kagome"))
        .args(args)
        .current_dir(folder)
        .output()
        .unwrap()
}

fn code(output: &Output) -> i32 {
    output.status.code().unwrap()
}

fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

#[test]
fn a_new_profile_is_accepted_by_check_and_never_written_over_another_file() {
    let folder = tempfile::tempdir().unwrap();
    for (verb, from) in [("machines", "plasma-generic"), ("materials", "steel-1.5")] {
        let name = format!("my-{verb}");
        let new = ["--quiet", verb, "new", &name, "--from", from];
        assert_eq!(code(&kagome(folder.path(), &new)), 0);
        let file = format!("{name}.toml");
        let checked = kagome(folder.path(), &[verb, "check", &file]);
        assert_eq!(code(&checked), 0, "{}", stderr(&checked));
        assert!(String::from_utf8_lossy(&checked.stdout).starts_with(&name));
        std::fs::write(folder.path().join(&file), "mine").unwrap();
        let again = kagome(folder.path(), &new);
        assert_eq!(code(&again), 2);
        assert!(stderr(&again).contains("--force"), "{}", stderr(&again));
        assert_eq!(
            std::fs::read_to_string(folder.path().join(&file)).unwrap(),
            "mine"
        );
        assert_eq!(code(&kagome(folder.path(), &[verb, "check", &file])), 1);
        let forced = [&new[..], &["--force"]].concat();
        assert_eq!(code(&kagome(folder.path(), &forced)), 0);
        assert_eq!(code(&kagome(folder.path(), &[verb, "check", &file])), 0);
        assert_eq!(code(&kagome(folder.path(), &[verb, "new", from])), 2);
    }
}

#[test]
fn a_controllers_answer_makes_the_profile_and_what_is_dangerous_in_it_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let dump =
        "$11=0.010\n$30=255\n$32=0\n$110=5000\n$111=4000\n$120=400\n$121=300\n$130=200\n$131=180\n";
    std::fs::write(folder.path().join("dollar.txt"), dump).unwrap();
    let args = "machines new mine --from diode-400 --settings dollar.txt -o here.toml";
    let made = kagome(folder.path(), &args.split(' ').collect::<Vec<_>>());
    assert_eq!(code(&made), 0, "{}", stderr(&made));
    assert!(stderr(&made).contains("$32=1"), "{}", stderr(&made));
    let shown = kagome(folder.path(), &["--json", "machines", "show", "here.toml"]);
    let value: serde_json::Value = serde_json::from_slice(&shown.stdout).unwrap();
    assert_eq!(value["laser"]["s_max"], 255.0);
    assert_eq!(value["bed"]["width_mm"], 200.0);
}

#[test]
fn a_list_says_of_every_pair_whether_it_fits_and_why_not() {
    let folder = tempfile::tempdir().unwrap();
    let lists = [
        (["--json", "machines", "list", "--material", "steel-1.5"], 3),
        (["--json", "materials", "list", "--machine", "fibre-300"], 3),
    ];
    for (args, fits) in lists {
        let listed = kagome(folder.path(), &args);
        let rows: Vec<serde_json::Value> = serde_json::from_slice(&listed.stdout).unwrap();
        let good = rows
            .iter()
            .filter(|r| r["answer"]["fit"] == "compatible")
            .count();
        assert_eq!(good, fits);
        for row in rows.iter().filter(|r| r["answer"]["fit"] != "compatible") {
            let why = row["answer"]["why"].as_str().unwrap();
            assert!(why.contains("add a [[cut]]"), "{why}");
        }
    }
}

#[test]
fn nothing_is_streamed_to_a_controller_that_opens_files() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("job.nc"), "G21\nG90\nG0 X1 Y1\nM2\n").unwrap();
    for machine in ["plasma-qtplasmac", "plasma-generic"] {
        let args = ["send", "job.nc", "--port", "sim", "--machine", machine];
        let sent = kagome(folder.path(), &args);
        assert_eq!(code(&sent), 2);
        assert!(stderr(&sent).contains("as a file"), "{}", stderr(&sent));
    }
}
