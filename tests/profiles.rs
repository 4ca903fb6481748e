//! `kagome machines` and `kagome materials`: a profile of one's own is made, checked and used by its name or its file.

#![allow(clippy::unwrap_used, reason = "a helper that fails, fails its test")]

use std::path::Path;
use std::process::{Command, Output};

/// With no profiles of a person's own.
fn kagome(folder: &Path, args: &[&str]) -> Output {
    kagome_of(Path::new(""), folder, args)
}

/// As somebody whose own profiles lie in `own`.
fn kagome_of(own: &Path, folder: &Path, args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_kagome"))
        .env("KAGOME_PROFILES", own)
        .args(args)
        .current_dir(folder)
        .output()
        .unwrap()
}

fn code(output: &Output) -> i32 {
    output.status.code().unwrap()
}

fn stdout(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
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
fn ones_own_profiles_are_found_by_name_before_shipped_ones() {
    let folder = tempfile::tempdir().unwrap();
    let own = folder.path().join("own");
    let run = |args: &[&str]| kagome_of(&own, folder.path(), args);
    // A folder that is not there is none.
    assert!(!stdout(&run(&["machines", "list"])).contains("yours"));
    let new = ["machines", "new", "mine", "--from", "diode-400", "--own"];
    let made = run(&new);
    assert_eq!(code(&made), 0, "{}", stderr(&made));
    assert!(
        stderr(&made).contains("--machine mine"),
        "{}",
        stderr(&made)
    );
    let file = own.join("machines").join("mine.toml");
    let text = std::fs::read_to_string(&file).unwrap();
    assert_eq!(code(&run(&new)), 2);
    assert_eq!(code(&run(&["machines", "check", "mine"])), 0);
    assert_eq!(
        code(&kagome(folder.path(), &["machines", "check", "mine"])),
        2
    );
    let shown = stdout(&run(&["machines", "show", "mine"]));
    assert_eq!(shown, format!("# {}\n{text}", file.display()));

    // A shipped one with a wider hinge, under its own name; and one that is broken, one that is called otherwise.
    let shipped = stdout(&run(&["materials", "show", "leather-1.6"]));
    let profiles = own.join("profiles");
    std::fs::create_dir(&profiles).unwrap();
    let wider = "hinge_width_mm = 1.25 #";
    let mine = shipped.replacen("hinge_width_mm =", wider, 1);
    std::fs::write(profiles.join("leather-1.6.toml"), mine).unwrap();
    std::fs::write(profiles.join("old.toml"), "format = 1\nthick = 3\n").unwrap();
    std::fs::write(profiles.join("other.toml"), &shipped).unwrap();
    let json = |args: &[&str]| -> serde_json::Value {
        serde_json::from_slice(&run(&[&["--json"], args].concat()).stdout).unwrap()
    };
    let value = json(&["materials", "show", "leather-1.6"]);
    assert_eq!(value["hinge_width_mm"], 1.25);
    assert_eq!(value["from"], "yours");
    assert_eq!(
        value["file"],
        profiles.join("leather-1.6.toml").to_str().unwrap()
    );
    let listed = json(&["materials", "list"]);
    let rows = |name: &str| -> Vec<&serde_json::Value> {
        let all = listed.as_array().unwrap().iter();
        all.filter(|r| r["name"] == name).collect()
    };
    assert_eq!(rows("leather-1.6").len(), 1);
    assert_eq!(rows("leather-1.6")[0]["hinge_width_mm"], 1.25);
    assert_eq!(rows("plywood-3")[0]["from"], "shipped");
    assert!(rows("old")[0]["error"].as_str().unwrap().contains("line 2"));
    assert!(
        rows("other")[0]["error"]
            .as_str()
            .unwrap()
            .contains("other.toml")
    );
    for list in [
        vec!["materials", "list"],
        vec!["materials", "list", "--machine", "mine"],
    ] {
        let text = stdout(&run(&list));
        let line = |name: &str| text.lines().find(|l| l.starts_with(name)).unwrap();
        assert!(line("leather-1.6").contains(" yours "), "{text}");
        assert!(line("plywood-3").contains(" shipped "), "{text}");
        assert!(line("old").contains("thick"), "{text}");
    }
    // Asked for by name, it is an error that shows the line; a no where the question is whether it is right.
    for (args, expected) in [
        (vec!["materials", "check", "old"], 1),
        (vec!["materials", "show", "old"], 2),
        (vec!["materials", "check", "other"], 1),
        (vec!["machines", "list", "--material", "old"], 2),
        (vec!["flatten", "sample:cap", "--material", "old"], 2),
    ] {
        let output = run(&args);
        assert_eq!(code(&output), expected, "{args:?}");
        assert!(stderr(&output).contains(".toml:"), "{}", stderr(&output));
    }
    let unknown = run(&["materials", "show", "lether"]);
    assert!(
        stderr(&unknown).contains("Yours: leather-1.6, old, other."),
        "{}",
        stderr(&unknown)
    );
}

#[test]
fn a_design_with_ones_own_profiles_gives_the_same_bytes_wherever_they_are_looked_for() {
    let folder = tempfile::tempdir().unwrap();
    let own = folder.path().join("own");
    let run = |args: &[&str]| kagome_of(&own, folder.path(), args);
    for (verb, name, from) in [
        ("machines", "mine", "diode-400"),
        ("materials", "soft", "leather-1.6"),
    ] {
        let made = run(&["--quiet", verb, "new", name, "--from", from, "--own"]);
        assert_eq!(code(&made), 0, "{}", stderr(&made));
    }
    let make = "make sample:cap --triangles 60 --material soft --machine mine -o one";
    let made = run(&make.split(' ').collect::<Vec<_>>());
    assert_eq!(code(&made), 0, "{}", stderr(&made));
    assert!(stderr(&made).contains("price_per_m2"), "{}", stderr(&made));
    let read = |file: &str| std::fs::read_to_string(folder.path().join(file)).unwrap();
    let design = read("one/design.toml");
    assert!(
        design.contains("material = \"../own/profiles/soft.toml\""),
        "{design}"
    );
    assert!(
        design.contains("machine = \"../own/machines/mine.toml\""),
        "{design}"
    );
    let again = kagome(folder.path(), &["make", "one/design.toml", "-o", "two"]);
    assert_eq!(code(&again), 0, "{}", stderr(&again));
    for file in ["design.toml", "pattern.svg", "job.nc", "report.json"] {
        assert_eq!(
            read(&format!("one/{file}")),
            read(&format!("two/{file}")),
            "{file}"
        );
    }
    // The header's name finds the machine again, where there is one of that name.
    let verify = ["verify", "one/job.nc"];
    assert_eq!(code(&run(&verify)), 0);
    assert_eq!(code(&kagome(folder.path(), &verify)), 2);
    // A shipped name in a design is the shipped one, even where it is hidden: with these figures nothing could be cut.
    let hidden = read("own/profiles/soft.toml")
        .replace("name = \"soft\"", "name = \"leather-1.6\"")
        .replace("laser = \"diode\"", "laser = \"fibre\"");
    std::fs::write(own.join("profiles/leather-1.6.toml"), hidden).unwrap();
    for (material, expected) in [("leather-1.6", 0), ("soft", 0), ("gone", 2)] {
        let named = design.replace("../own/profiles/soft.toml", material);
        std::fs::write(
            folder.path().join("named.toml"),
            named.replace("../own", "own"),
        )
        .unwrap();
        let output = run(&["make", "named.toml", "--force", "-o", "three"]);
        assert_eq!(code(&output), expected, "{material}: {}", stderr(&output));
    }
    let asked = make.replace("soft", "leather-1.6").replace("one", "four");
    assert_eq!(code(&run(&asked.split(' ').collect::<Vec<_>>())), 2);
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
        (["--json", "machines", "list", "--material", "steel-1.5"], 4),
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
