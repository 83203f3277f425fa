//! Whether a map fits into memory: a program that runs out of it is ended by the system, and takes all that
//! it serves with it.

use crate::config::Config;
use crate::error::{Error, Result};
use rustix::process::{Resource, getrlimit};
use std::fs;
use std::path::Path;

/// Memory for a pixel of the map, measured for maps of 1 to 4 million pixels (108 and 206 bytes more for each
/// pixel, 2048 x 512 and 4096 x 1024 of the bundled fisheye sequence): what is used, and what is set aside.
const USED_BYTES: u64 = 128;
const ADDRESS_BYTES: u64 = 224;

/// Checks that a service with this configuration fits into what is left, beside the one that runs.
///
/// # Errors
/// Kind `Usage`, naming what limits it.
pub(super) fn check(config: &Config) -> Result<()> {
    let pixels = (config.map.columns() as u64).saturating_mul(config.map.rows() as u64);
    let text = |path: &str| fs::read_to_string(path).unwrap_or_default();
    let limits = [
        ("the machine", USED_BYTES, kilobytes(&text("/proc/meminfo"), "MemAvailable:")),
        (
            "the control group",
            USED_BYTES,
            left_in_groups(&text("/proc/self/cgroup"), Path::new("/sys/fs/cgroup")),
        ),
        (
            "the limit of the address space (ulimit -v)",
            ADDRESS_BYTES,
            left_of_addresses(&text("/proc/self/status")),
        ),
    ];
    for (what, bytes_per_pixel, left) in limits {
        let needed = pixels.saturating_mul(bytes_per_pixel);
        if let Some(left) = left
            && needed > left
        {
            let mb = |bytes: u64| bytes.div_ceil(1 << 20);
            let error = Error::usage(format!(
                "a map of {pixels} pixels needs about {} MB of memory, and {what} has {} MB left: give fewer columns \
                 and rows",
                mb(needed),
                mb(left)
            ));
            return Err(config.locate("map", error));
        }
    }
    Ok(())
}

fn left_of_addresses(status: &str) -> Option<u64> {
    let limit = getrlimit(Resource::As).current?;
    Some(limit.saturating_sub(kilobytes(status, "VmSize:").unwrap_or(0)))
}

/// The value of a line such as `MemAvailable:   23456 kB`, in bytes.
fn kilobytes(text: &str, key: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix(key))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()?.checked_mul(1024)
}

/// What is left in the control group that `cgroup` (the text of /proc/self/cgroup) names, and in those around
/// it, whose files are below `root`; `None`: none has a limit.
fn left_in_groups(cgroup: &str, root: &Path) -> Option<u64> {
    let groups = cgroup.lines().filter_map(|line| {
        let (_, rest) = line.split_once(':')?;
        let (controllers, path) = rest.split_once(':')?;
        let path = path.trim_start_matches('/');
        match controllers {
            "" => Some((root.to_owned(), path, ["memory.max", "memory.current"])),
            _ if controllers.split(',').any(|name| name == "memory") => {
                Some((root.join("memory"), path, ["memory.limit_in_bytes", "memory.usage_in_bytes"]))
            }
            _ => None,
        }
    });
    let number = |path: &Path| fs::read_to_string(path).ok()?.trim().parse::<u64>().ok();
    let left = groups.flat_map(|(root, path, [limit, usage])| {
        let folder = root.join(path);
        let around = folder.ancestors().take_while(|folder| folder.starts_with(&root));
        around
            .filter_map(|folder| {
                Some(number(&folder.join(limit))?.saturating_sub(number(&folder.join(usage))?))
            })
            .min()
    });
    left.min()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_narrowest_group_counts() {
        let root = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| {
            let path = root.path().join(name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, text).unwrap();
        };
        let left = |cgroup: &str| left_in_groups(cgroup, root.path());
        assert_eq!(left("0::/a.slice/b.service\n"), None);
        write("a.slice/memory.max", "1000\n");
        write("a.slice/memory.current", "400\n");
        write("a.slice/b.service/memory.max", "max\n");
        write("a.slice/b.service/memory.current", "100\n");
        assert_eq!(left("0::/a.slice/b.service\n"), Some(600));
        write("a.slice/b.service/memory.max", "300\n");
        assert_eq!(left("0::/a.slice/b.service\n"), Some(200));
        write("memory/box/memory.limit_in_bytes", "50\n");
        write("memory/box/memory.usage_in_bytes", "70\n");
        assert_eq!(left("4:cpu,memory:/box\n0::/a.slice/b.service\n"), Some(0));
        assert_eq!(left("nonsense"), None);
    }

    #[test]
    fn values_of_proc_are_in_kilobytes() {
        assert_eq!(kilobytes("MemTotal:  9 kB\nMemAvailable:   23 kB\n", "MemAvailable:"), Some(23 * 1024));
        assert_eq!(kilobytes("MemAvailable: many kB", "MemAvailable:"), None);
    }
}
