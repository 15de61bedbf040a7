//! The arguments of `axle tap` and `axle top`.

/// Arguments of `axle tap`.
#[derive(Debug, clap::Args)]
pub(crate) struct Tap {
    /// The keys: axle/r1/navigator/pose, axle/r1/**, axle/*/gate/state …
    pub(crate) keys: String,
    /// Begin with what was measured in this time before now, such as 5s, from the buffers of Source
    #[arg(long, value_name = "TIME", value_parser = time, conflicts_with_all = ["hz", "bw", "age"])]
    pub(crate) since: Option<f64>,
    /// Print JSON
    #[arg(long)]
    pub(crate) json: bool,
    /// End after that many messages
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub(crate) count: Option<u64>,
    /// End after that time: 10s, 500ms, 2min, or seconds
    #[arg(long = "for", value_name = "TIME", value_parser = time)]
    pub(crate) time: Option<f64>,
    /// Print the rate of each stream, once a second
    #[arg(long, conflicts_with_all = ["bw", "field", "age"])]
    pub(crate) hz: bool,
    /// Print the bandwidth of each stream, once a second
    #[arg(long, conflicts_with_all = ["field", "age"])]
    pub(crate) bw: bool,
    /// Print how old each message is when it comes, by the clocks of sender and listener, and how sure that is
    #[arg(long, conflicts_with = "field")]
    pub(crate) age: bool,
    /// Print one field of each message, and its course so far: .pose.x, .wheels.left, .twist.omega
    #[arg(long, value_name = "PATH")]
    pub(crate) field: Option<String>,
    /// Only messages of which this holds: ".pose.x > 1", ".enabled == false", ".phase != \"running\""
    #[arg(long = "where", value_name = "CONDITION")]
    pub(crate) condition: Option<String>,
}

/// Arguments of `axle top`.
#[derive(Debug, clap::Args)]
pub(crate) struct Top {
    /// Print what it would show, once, as JSON, and end
    #[arg(long)]
    pub(crate) json: bool,
}

/// Seconds of `10s`, `500ms`, `2min` or `10`.
fn time(text: &str) -> Result<f64, String> {
    let units = [("ms", 1e-3), ("min", 60.0), ("s", 1.0), ("h", 3600.0)];
    let (number, unit) =
        units.iter().find_map(|(name, unit)| Some((text.strip_suffix(name)?, *unit))).unwrap_or((text, 1.0));
    match number.trim().parse::<f64>() {
        Ok(number) if (0.001..=1e6).contains(&(number * unit)) => Ok(number * unit),
        _ => Err("write a time: 10s, 500ms, 2min; 1 ms to 1e6 s".into()),
    }
}

#[cfg(test)]
mod tests {
    use super::time;

    #[test]
    fn times_are_read_with_and_without_a_unit() {
        for (text, seconds) in [("10s", 10.0), ("500ms", 0.5), ("2min", 120.0), ("3", 3.0), ("0.5h", 1800.0)]
        {
            assert_eq!(time(text), Ok(seconds), "{text}");
        }
        for text in ["", "s", "-1s", "nan", "1e99", "10 parsecs"] {
            assert!(time(text).is_err(), "{text}");
        }
    }
}
