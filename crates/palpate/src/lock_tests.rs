//! Locks between threads, and against what another machine would have written.

use super::*;

/// Long enough for a heart on a busy machine, which has six beats in it; short enough for a test.
const SHORT: Duration = Duration::from_secs(2);

fn mine(folder: &Path, patience: Duration) -> Lock {
    match Lock::take(folder, patience).expect("the folder is writable") {
        Taken::Mine(lock) => lock,
        Taken::Held(held) => panic!("{held} has it"),
    }
}

fn held(folder: &Path) -> Held {
    match Lock::take(folder, SHORT).expect("the folder is writable") {
        Taken::Mine(_) => panic!("it was free"),
        Taken::Held(held) => held,
    }
}

/// What another process would have written.
fn foreign(folder: &Path, change: impl Fn(&mut LockDocument)) {
    let mut document = LockDocument {
        beat: beat(3),
        host: "elsewhere".into(),
        process: 1,
        since: "2026-01-31T12:00:00Z".into(),
        patience: SHORT.as_secs_f64(),
        namespace: "another pid:[1]".into(),
        beginning: None,
        token: "elsewhere-1".into(),
    };
    change(&mut document);
    fs::write(folder.join(NAME), results::line(&document)).expect("writable");
}

/// A process that has ended, of this machine.
#[cfg(unix)]
fn ended() -> u32 {
    let mut child = std::process::Command::new("true").spawn().expect("the program starts");
    child.wait().expect("it ends");
    child.id()
}

#[test]
fn a_lock_names_its_process_and_is_gone_with_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let lock = mine(folder.path(), PATIENCE);
    let text = fs::read_to_string(folder.path().join(NAME)).expect("a lock");
    let document: LockDocument = results::parse(&text, NAME).expect("it can be read");
    assert_eq!((document.process, document.patience), (std::process::id(), 60.0));
    assert!(!document.host.is_empty() && document.since.starts_with("20") && document.since.ends_with('Z'), "{text}");
    let other = held(folder.path());
    assert!(!other.has_ended() && other.to_string().starts_with(&format!("process {} on ", std::process::id())), "{other}");
    assert!(!lock.is_lost() && lock.check().is_ok());
    drop(lock);
    assert_eq!(fs::read_dir(folder.path()).expect("it is there").count(), 0);
    drop(mine(folder.path(), PATIENCE));
}

#[test]
fn a_heart_that_beats_is_seen_and_one_that_is_still_is_buried() {
    let folder = tempfile::tempdir().expect("a folder");
    let lock = mine(folder.path(), SHORT);
    let stop = Interrupt::default();
    let begun = Instant::now();
    assert!(!held(folder.path()).watch(&stop).expect("readable"), "it lives");
    // The next beat is a sixth away; a busy machine may be late with it.
    assert!(begun.elapsed() < SHORT, "{:?}", begun.elapsed());
    drop(lock);
    // A process elsewhere that died: nobody here knows, and nothing changes.
    foreign(folder.path(), |_| {});
    let dead = held(folder.path());
    assert!(!dead.has_ended());
    let begun = Instant::now();
    assert!(dead.watch(&stop).expect("readable"));
    assert!(begun.elapsed() >= SHORT, "{:?}", begun.elapsed());
    drop(mine(folder.path(), SHORT));
    // One that is released meanwhile need not be waited for; who is interrupted does not wait.
    foreign(folder.path(), |d| d.patience = 1e4);
    let other = held(folder.path());
    let raised = Interrupt::default();
    raised.raise();
    assert!(!other.watch(&raised).expect("readable"));
    fs::remove_file(folder.path().join(NAME)).expect("removable");
    assert!(other.watch(&stop).expect("readable"));
}

#[cfg(target_os = "linux")]
#[test]
fn a_process_of_this_machine_that_has_ended_is_not_waited_for() {
    let folder = tempfile::tempdir().expect("a folder");
    let here = |process: u32, beginning: Option<u64>| {
        foreign(folder.path(), |d| {
            (d.host, d.namespace, d.process, d.beginning, d.patience) = (host(), namespace(), process, beginning, 1e4);
        });
    };
    here(ended(), None);
    drop(mine(folder.path(), PATIENCE));
    // The number was given to another process since.
    let own = beginning(std::process::id()).expect("Linux says so");
    here(std::process::id(), Some(own + 1));
    drop(mine(folder.path(), PATIENCE));
    here(std::process::id(), Some(own));
    assert!(!held(folder.path()).has_ended());
    // In a container, numbers are others: nothing is known.
    foreign(folder.path(), |d| (d.host, d.process, d.patience) = (host(), ended(), 1e4));
    assert!(!held(folder.path()).has_ended());
}

#[test]
fn of_many_who_see_a_dead_lock_one_gets_it() {
    for round in 0..20 {
        let folder = tempfile::tempdir().expect("a folder");
        foreign(folder.path(), |d| d.patience = 0.0);
        let dead = held(folder.path());
        let got = std::thread::scope(|s| {
            let compete = || {
                // Whoever comes late sees that something has changed.
                dead.remove().expect("writable");
                Lock::take(folder.path(), PATIENCE).expect("writable")
            };
            let all: Vec<_> = (0..8).map(|_| s.spawn(compete)).collect();
            all.into_iter().map(|t| t.join().expect("no panic")).collect::<Vec<_>>()
        });
        let living = got.iter().filter(|t| matches!(t, Taken::Mine(lock) if !lock.is_lost())).count();
        assert_eq!(living, 1, "round {round}");
    }
}

#[test]
fn whoever_was_still_for_too_long_writes_no_more() {
    let folder = tempfile::tempdir().expect("a folder");
    let lock = mine(folder.path(), SHORT);
    let all = Interrupt::default();
    let guard = lock.guard(&all);
    assert!(!guard.is_raised());
    foreign(folder.path(), |_| {});
    let begun = Instant::now();
    while !guard.is_raised() {
        assert!(begun.elapsed() < Duration::from_secs(20), "the loss is not noticed");
        std::thread::sleep(Duration::from_millis(10));
    }
    assert!(!all.is_raised(), "the other scenes go on");
    let told = lock.check().expect_err("it is lost").to_string();
    assert!(told.contains("process 1 on elsewhere") && told.contains("nothing more was written"), "{told}");
    drop(lock);
    // What is another's stays.
    assert_eq!(held(folder.path()).holder.map(|h| h.token), Some("elsewhere-1".into()));
}

#[test]
fn a_lock_that_cannot_be_read_has_an_unknown_holder_and_the_usual_patience() {
    let folder = tempfile::tempdir().expect("a folder");
    for text in ["", "{\"format\": \"lock/2\"}", "\u{0}\u{0}"] {
        fs::write(folder.path().join(NAME), text).expect("writable");
        let held = held(folder.path());
        assert_eq!((held.patience(), held.has_ended()), (PATIENCE, false));
        assert!(held.to_string().starts_with("whoever made "), "{held}");
    }
}
