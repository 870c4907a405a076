//! What the operating system says about this process and its machine: processor time, memory.
//!
//! Read from the files under `/proc` and `/sys` of Linux; every function is `None` where these
//! do not exist.

use std::fs;
use std::path::Path;

/// Clock ticks a second in `/proc/self/stat` where the kernel does not say (all of today's
/// Linux machines but the oldest architectures).
const USUAL_TICKS: f64 = 100.0;

/// Processor seconds that this process has used, user and system, of all its threads; to 0.01 s.
pub fn cpu_seconds() -> Option<f64> {
    let stat = fs::read_to_string("/proc/self/stat").ok()?;
    Some(ticks_used(&stat)? as f64 / ticks_per_second().unwrap_or(USUAL_TICKS))
}

/// The most memory that this process has held at one time, bytes.
pub fn peak_memory() -> Option<u64> {
    kilobytes(&fs::read_to_string("/proc/self/status").ok()?, "VmHWM:")
}

/// Memory that this process may use, bytes: that of the machine, or less where the process runs
/// in a control group (a container) with a limit, or has a limit of its own (`ulimit -v`).
pub fn usable_memory() -> Option<u64> {
    let machine = fs::read_to_string("/proc/meminfo").ok();
    let machine = machine.and_then(|text| kilobytes(&text, "MemTotal:"));
    let own = fs::read_to_string("/proc/self/limits").ok();
    let own = own.and_then(|text| soft_limit(&text, "Max address space"));
    machine.into_iter().chain(group_limit()).chain(own).min()
}

/// The soft one of the limits in a line `NAME  soft  hard  unit`; `unlimited` is none.
fn soft_limit(text: &str, name: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix(name))?;
    line.split_ascii_whitespace().next()?.parse().ok()
}

/// User and system ticks: the 14th and 15th fields. The second is the program's name in
/// brackets, which may hold anything, so that counting starts behind the last bracket.
fn ticks_used(stat: &str) -> Option<u64> {
    let mut fields = stat.rsplit_once(')')?.1.split_ascii_whitespace().skip(11);
    let user: u64 = fields.next()?.parse().ok()?;
    let system: u64 = fields.next()?.parse().ok()?;
    Some(user + system)
}

/// Ticks a second, from the auxiliary vector: pairs of native words (kind, value).
fn ticks_per_second() -> Option<f64> {
    const AT_CLKTCK: usize = 17;
    const WORD: usize = size_of::<usize>();
    let words: Vec<usize> = fs::read("/proc/self/auxv")
        .ok()?
        .chunks_exact(WORD)
        .filter_map(|bytes| bytes.try_into().ok().map(usize::from_ne_bytes))
        .collect();
    let pair = words.chunks_exact(2).find(|pair| pair[0] == AT_CLKTCK)?;
    (pair[1] > 0).then_some(pair[1] as f64)
}

/// A line `NAME   123 kB`, in bytes.
fn kilobytes(text: &str, name: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix(name))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()?.checked_mul(1024)
}

/// The least memory limit of the control groups that this process is in. Version 2 of the
/// interface has one tree with a limit at each level; version 1 keeps memory in a tree of its own.
fn group_limit() -> Option<u64> {
    let memberships = fs::read_to_string("/proc/self/cgroup").unwrap_or_default();
    let mut limits = Vec::new();
    for line in memberships.lines() {
        // Lines are `number:controllers:/path`, version 2 with number 0 and no controllers.
        let mut parts = line.splitn(3, ':');
        let (_, Some(controllers), Some(path)) = (parts.next(), parts.next(), parts.next()) else {
            continue;
        };
        let (root, file) = match controllers {
            "" => ("/sys/fs/cgroup", "memory.max"),
            _ if controllers.split(',').any(|c| c == "memory") => {
                ("/sys/fs/cgroup/memory", "memory.limit_in_bytes")
            }
            _ => continue,
        };
        // Inside a container the path may not exist, but its ancestor, the root, does.
        let place = Path::new(root).join(path.trim_start_matches('/'));
        let levels = place.ancestors().take_while(|level| level.starts_with(root));
        limits.extend(levels.filter_map(|level| limit_in(&level.join(file))));
    }
    limits.into_iter().min()
}

/// A limit in bytes; `max` (version 2) is none.
fn limit_in(file: &Path) -> Option<u64> {
    fs::read_to_string(file).ok()?.trim().parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_found_behind_a_name_with_brackets_and_spaces() {
        let stat = "7 (a) b (c) S 1 2 3 4 5 6 7 8 9 10 250 50 0 0 20 0";
        assert_eq!(ticks_used(stat), Some(300));
        assert_eq!(ticks_used("nonsense"), None);
    }

    #[test]
    fn memory_lines_are_in_kilobytes() {
        let text = "VmPeak:\t  99 kB\nVmHWM:\t   12 kB\n";
        assert_eq!(kilobytes(text, "VmHWM:"), Some(12 * 1024));
        assert_eq!(kilobytes(text, "VmSwap:"), None);
    }

    #[test]
    fn limits_of_the_process_are_in_bytes_or_unlimited() {
        let text = "Limit     Soft Limit    Hard Limit   Units\n\
                    Max data size    unlimited    unlimited   bytes\n\
                    Max address space    4096    8192    bytes\n";
        assert_eq!(soft_limit(text, "Max address space"), Some(4096));
        assert_eq!(soft_limit(text, "Max data size"), None);
        assert_eq!(soft_limit(text, "Max file size"), None);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn linux_answers_and_time_only_grows() {
        let before = cpu_seconds().unwrap();
        let memory = vec![1u8; 32 << 20];
        let sum: u64 = (0..20).map(|_| memory.iter().map(|&v| u64::from(v)).sum::<u64>()).sum();
        assert_eq!(sum, 20 * (32 << 20));
        assert!(cpu_seconds().unwrap() >= before);
        assert!(peak_memory().unwrap() >= 32 << 20);
        assert!(usable_memory().unwrap() >= peak_memory().unwrap());
        assert!(ticks_per_second().unwrap() > 0.0);
    }
}
