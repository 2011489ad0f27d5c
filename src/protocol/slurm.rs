//! The script that has Slurm do a benchmark's runs: a job array, one task a shard, for `sbatch`. Text only: nothing here starts a
//! job, talks to Slurm or knows what a run is.
//!
//! A task is one shard of the plan, written as `--shard I/N`. Tasks share the benchmark's folder and nothing else, and a task that is
//! started again goes on with what its shard has not finished, so that the script asks Slurm to queue a task again that was preempted
//! or lost its node.

use crate::{Error, Result};
use std::path::PathBuf;
use std::time::Duration;

/// A benchmark as a job array. Paths that are relative start from the folder in which `sbatch` is called.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct JobArray {
    /// The program, by its name on the nodes' search path or by its path there.
    pub program: String,
    /// Its arguments, as they would stand without Slurm: `benchmark`, the data, `-o` and its folder, the plan. Without `--threads`,
    /// `--shard` and a closing `--`: the script adds the first two at the end.
    pub arguments: Vec<String>,
    /// How many tasks the runs are divided among, at least 1. Slurm's own limit is its setting `MaxArraySize`, 1000 tasks by default.
    pub shards: usize,
    /// Processors (as Slurm counts them) of one task, and so its threads; at least 1.
    pub cpus: usize,
    /// The benchmark's folder, the one after `-o`. The tasks' logs go into its folder `logs`.
    pub output: PathBuf,
    /// How long one task may take before Slurm ends it, rounded up to whole minutes. Without one, the partition's limit holds.
    pub time_limit: Option<Duration>,
}

impl JobArray {
    /// The script. Its opening comment says how to submit it and how to have the tables made after it.
    ///
    /// # Errors
    ///
    /// For numbers that are zero, and for text that Slurm or a script cannot carry: NUL or a DOS line end in an argument, control
    /// characters in the program or the folder, a backslash in the folder (Slurm then leaves the task's number out of the log's name),
    /// a folder that is not UTF-8.
    pub fn script(&self) -> Result<String> {
        let output = self.checked()?;
        let Self { shards, cpus, .. } = self;
        let folder = output.strip_suffix('/').unwrap_or(output);
        let logs = format!("{folder}/logs");
        let make_logs = quoted(&logs);
        let collect_log = quoted(&format!("{}/collect.log", pattern(&logs)));
        let collect = quoted(&format!("{} benchmark collect {}", quoted(&self.program), quoted(output)));
        let task_log = directive(&format!("{}/%A_%a.log", pattern(&logs)));
        let time = match self.time_limit {
            Some(limit) => format!("#SBATCH --time={}\n", limit.as_millis().div_ceil(60_000)),
            None => String::new(),
        };
        let words: Vec<String> = std::iter::once(&self.program).chain(&self.arguments).map(|word| quoted(word)).collect();
        let command = words.join(" ");
        Ok(format!(
            r##"#!/usr/bin/env bash
# A benchmark of phyture as a job array for Slurm: {shards} tasks, each doing one of {shards} shards of the runs.
#
# To submit it, and after it the job that makes the tables. `array.sh` is this file; relative paths in it start from the folder you are
# in. The folder of the logs has to be there first: Slurm opens a task's log before the task starts, and makes no folder.
#
#   mkdir -p {make_logs}
#   array=$(sbatch --parsable array.sh)
#   sbatch --dependency="afterok:$array" --kill-on-invalid-dep=yes --job-name=phyture-collect --output={collect_log} --wrap={collect}
#
# What is given to sbatch wins over the lines below: --account, --partition, --mem, --time, --cpus-per-task.
#
# Slurm itself queues a task again that was preempted or lost its node. It does not if a task failed, was killed or ran out of time; then
# no tables are made. Submit those tasks again, for instance `sbatch --array=2,5 array.sh`, and the tables after them as above. Either
# way a task goes on after the runs it has finished. How many shards there are stays in the last line, whichever tasks are submitted.
#
# Nodes of different instruction sets may round differently. If they are mixed, ask for one kind with --constraint, or for one level on
# all of them, for instance `PHYTURE_ISA=avx2 sbatch array.sh`.
#SBATCH --job-name=phyture-benchmark
#SBATCH --array=1-{shards}
#SBATCH --nodes=1
#SBATCH --ntasks=1
#SBATCH --cpus-per-task={cpus}
{time}#SBATCH --output={task_log}
#SBATCH --open-mode=append
#SBATCH --requeue
set -euo pipefail
exec {command} --threads "$SLURM_CPUS_PER_TASK" --shard "$SLURM_ARRAY_TASK_ID/{shards}"
"##
        ))
    }

    /// The folder as text, if everything can be written down.
    fn checked(&self) -> Result<&str> {
        let refused = |field: &str, found: String, expected: &str| {
            Err(Error::Config { place: "job array for Slurm".into(), field: field.into(), found, expected: expected.into() })
        };
        for (field, number) in [("shards", self.shards), ("cpus", self.cpus)] {
            if number == 0 {
                return refused(field, "0".into(), "at least 1");
            }
        }
        if self.time_limit.is_some_and(|limit| limit.is_zero()) {
            return refused("time_limit", "0".into(), "more than nothing; leave it out for the partition's limit");
        }
        if self.program.is_empty() || self.program.contains(char::is_control) {
            return refused("program", format!("{:?}", self.program), "a name or a path without control characters");
        }
        if let Some(argument) = self.arguments.iter().find(|argument| argument.contains('\0') || argument.contains("\r\n")) {
            return refused("arguments", format!("{argument:?}"), "text without NUL and without DOS line ends");
        }
        match self.output.to_str() {
            Some(output) if !output.is_empty() && !output.contains(|c: char| c.is_control() || c == '\\') => Ok(output),
            _ => refused(
                "output",
                format!("{:?}", self.output),
                "a folder whose name is UTF-8 without control characters and backslashes",
            ),
        }
    }
}

/// One word of a POSIX shell that stands for `argument`.
fn quoted(argument: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "_-+,.:/@%".contains(c);
    if !argument.is_empty() && argument.chars().all(plain) {
        return argument.into();
    }
    // Nothing but the quote itself ends a quoted text: leave it, write the quote escaped, go on.
    format!("'{}'", argument.replace('\'', r"'\''"))
}

/// A file's name as Slurm writes it, in which `%` opens a replacement.
fn pattern(name: &str) -> String {
    name.replace('%', "%%")
}

/// One word of a line `#SBATCH`, which has rules of its own: blanks need quotes (a backslash does not keep them together), and between
/// quotes a backslash escapes.
fn directive(word: &str) -> String {
    let mut text = String::from("\"");
    for c in word.chars() {
        if matches!(c, '"' | '\\') {
            text.push('\\');
        }
        text.push(c);
    }
    text.push('"');
    text
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::process::{Command, Output};

    fn array() -> JobArray {
        JobArray {
            program: "phyture".into(),
            arguments: ["benchmark", "flights", "-o", "two", "--plan", "quick"].map(String::from).into(),
            shards: 12,
            cpus: 4,
            output: "two".into(),
            time_limit: None,
        }
    }

    /// What a script given to `shell -c` does, with or without the variables that Slurm sets for the third task.
    fn run(shell: &str, script: &str, slurm: bool) -> Output {
        let mut command = Command::new(shell);
        command.arg("-c").arg(script).env_remove("SLURM_CPUS_PER_TASK").env_remove("SLURM_ARRAY_TASK_ID");
        if slurm {
            command.env("SLURM_CPUS_PER_TASK", "4").env("SLURM_ARRAY_TASK_ID", "3");
        }
        command.output().unwrap()
    }

    /// What `printf '%s\0'` wrote.
    fn words(output: &Output) -> Vec<String> {
        assert!(output.status.success(), "{output:?}");
        let text = String::from_utf8(output.stdout.clone()).unwrap();
        text.strip_suffix('\0').unwrap().split('\0').map(String::from).collect()
    }

    /// Any text a process can be given, with the characters that mean something to a shell far oftener than chance has them.
    fn argument() -> impl Strategy<Value = String> {
        let special = proptest::sample::select("'\"\\$`!*?[]{}()<>|&;#~=%^-_ \t\n\ra".chars().collect::<Vec<_>>());
        let other = any::<char>().prop_filter("a process cannot be given NUL", |&c| c != '\0');
        proptest::collection::vec(prop_oneof![3 => special, 1 => other], 0..24).prop_map(|chars| chars.into_iter().collect())
    }

    proptest! {
        #[test]
        fn a_shell_gives_every_argument_back(first in argument(), second in argument()) {
            let output = run("sh", &format!(r"printf '%s\0' {} {}", quoted(&first), quoted(&second)), false);
            prop_assert_eq!(words(&output), [first, second]);
        }
    }

    #[test]
    fn plain_words_stay_readable_and_words_with_a_meaning_are_quoted() {
        assert_eq!(quoted("/data/run-1/log_2.csv"), "/data/run-1/log_2.csv");
        for word in ["", "a=b", "~", "#x", "if x", "$HOME", "*"] {
            assert_eq!(quoted(word), format!("'{word}'"));
        }
        assert_eq!(quoted("it's"), r"'it'\''s'");
    }

    #[test]
    fn a_task_runs_the_program_with_its_own_shard() {
        let strange = ["%s\\0", "two words", "it's", "$HOME `id`", "a\nb", "", "-o"];
        let array = JobArray { program: "printf".into(), arguments: strange.map(String::from).into(), ..array() };
        let script = array.script().unwrap();
        let expected: Vec<_> = strange[1..].iter().copied().chain(["--threads", "4", "--shard", "3/12"]).collect();
        assert_eq!(words(&run("bash", &script, true)), expected);
        // Outside of Slurm there is no shard to do: all of them, or none, would both be wrong.
        let outside = run("bash", &script, false);
        assert!(!outside.status.success() && outside.stdout.is_empty(), "{outside:?}");
    }

    #[test]
    fn the_directives_stand_before_the_first_command() {
        let limit = Some(Duration::from_millis(90 * 60_000 + 1));
        let script = JobArray { time_limit: limit, output: "my \"50%\" #1/".into(), ..array() }.script().unwrap();
        assert!(script.starts_with("#!"));
        let (comments, commands) = script.split_once("\nset -euo pipefail\n").unwrap();
        assert!(comments.lines().all(|line| line.starts_with('#')), "{comments}");
        assert!(!commands.contains("#SBATCH"), "{commands}");
        let directives: Vec<_> = comments.lines().filter_map(|line| line.strip_prefix("#SBATCH ")).collect();
        let expected = [
            "--job-name=phyture-benchmark",
            "--array=1-12",
            "--nodes=1",
            "--ntasks=1",
            "--cpus-per-task=4",
            "--time=91",
            r#"--output="my \"50%%\" #1/logs/%A_%a.log""#,
            "--open-mode=append",
            "--requeue",
        ];
        assert_eq!(directives, expected);
        assert!(!array().script().unwrap().contains("--time="));
    }

    #[test]
    fn the_commands_of_the_comment_do_what_it_says() {
        let array = JobArray { program: "./it's phyture".into(), output: "two runs, 50%".into(), ..array() };
        let script = array.script().unwrap();
        let commands: Vec<_> = script.lines().filter_map(|line| line.strip_prefix("#   ")).collect();
        let stubs = r#"mkdir() { printf '%s\0' mkdir "$@"; }
            sbatch() { if [ "$1" = --parsable ]; then echo 77; else printf '%s\0' sbatch "$@"; fi; }"#;
        let found = words(&run("sh", &format!("{stubs}\n{}", commands.join("\n")), false));
        let (wrapped, before) = found.split_last().unwrap();
        let expected = [
            "mkdir",
            "-p",
            "two runs, 50%/logs",
            "sbatch",
            "--dependency=afterok:77",
            "--kill-on-invalid-dep=yes",
            "--job-name=phyture-collect",
            "--output=two runs, 50%%/logs/collect.log",
        ];
        assert_eq!(before, expected);
        // What is wrapped goes through a shell once more.
        let inner = wrapped.strip_prefix("--wrap=").unwrap();
        let found = words(&run("sh", &format!(r"printf '%s\0' {inner}"), false));
        assert_eq!(found, ["./it's phyture", "benchmark", "collect", "two runs, 50%"]);
    }

    #[test]
    fn what_cannot_be_written_down_is_refused_by_name() {
        let cases = [
            ("`shards`", JobArray { shards: 0, ..array() }),
            ("`cpus`", JobArray { cpus: 0, ..array() }),
            ("`time_limit`", JobArray { time_limit: Some(Duration::ZERO), ..array() }),
            ("`program`", JobArray { program: String::new(), ..array() }),
            ("`program`", JobArray { program: "a\nb".into(), ..array() }),
            ("`arguments`", JobArray { arguments: vec!["a\0b".into()], ..array() }),
            ("`arguments`", JobArray { arguments: vec!["a\r\nb".into()], ..array() }),
            ("`output`", JobArray { output: PathBuf::new(), ..array() }),
            ("`output`", JobArray { output: "a\nb".into(), ..array() }),
            ("`output`", JobArray { output: r"a\b".into(), ..array() }),
        ];
        for (field, array) in cases {
            let message = array.script().unwrap_err().to_string();
            assert!(message.contains(field), "{field}: {message}");
        }
        assert!(array().script().is_ok());
    }
}
