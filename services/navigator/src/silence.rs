//! Sensors that spoke and speak no more.

use axle_schema::Seconds;
use axle_schema::event::{Event, Sensor};

/// Who was heard when.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Silence {
    /// The last stamps of encoders and gyro, and whether their silence was said.
    heard: [Option<(f64, bool)>; 2],
}

const fn index(sensor: Sensor) -> usize {
    match sensor {
        Sensor::Encoders => 0,
        Sensor::Gyro => 1,
    }
}

impl Silence {
    /// A sensor spoke: the others may have been silent for longer than `limit`.
    pub(crate) fn hear(&mut self, sensor: Sensor, stamp: f64, limit: f64) -> Option<Event> {
        let heard = &mut self.heard[index(sensor)];
        // What comes late, or once more, is no sign of life.
        if heard.is_none_or(|(last, _)| stamp > last) {
            *heard = Some((stamp, false));
        }
        let other = if sensor == Sensor::Gyro { Sensor::Encoders } else { Sensor::Gyro };
        self.miss(other, stamp, limit)
    }

    /// Nobody spoke for `elapsed` seconds of whatever clock: the encoders, which set the pace, are missed.
    pub(crate) fn wait(&mut self, elapsed: f64, limit: f64) -> Option<Event> {
        let newest = self.heard.iter().flatten().map(|heard| heard.0).reduce(f64::max)?;
        self.miss(Sensor::Encoders, newest + elapsed, limit)
    }

    fn miss(&mut self, sensor: Sensor, now: f64, limit: f64) -> Option<Event> {
        let (since, said) = self.heard[index(sensor)].as_mut()?;
        if *said || now - *since <= limit {
            return None;
        }
        *said = true;
        Some(Event::Silent { stamp: Seconds(now), sensor, since: Seconds(*since) })
    }

    /// A clock that begins anew.
    pub(crate) fn restart(&mut self) {
        self.heard = [None; 2];
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sensor_is_missed_once_and_again_after_it_has_spoken() {
        let mut silence = Silence::default();
        assert_eq!(silence.wait(9.0, 1.0), None, "what never spoke is not missed");
        assert_eq!(silence.hear(Sensor::Encoders, 1.0, 1.0), None);
        assert_eq!(silence.hear(Sensor::Gyro, 1.5, 1.0), None);
        let missed = silence.hear(Sensor::Gyro, 2.5, 1.0);
        let since = Seconds(1.0);
        assert_eq!(missed, Some(Event::Silent { stamp: Seconds(2.5), sensor: Sensor::Encoders, since }));
        assert_eq!(silence.hear(Sensor::Gyro, 3.5, 1.0), None, "it was said");
        assert_eq!(silence.hear(Sensor::Encoders, 4.0, 1.0), None);
        assert_eq!(silence.wait(0.5, 1.0), None);
        assert!(matches!(silence.wait(1.5, 1.0), Some(Event::Silent { stamp: Seconds(5.5), .. })));
    }
}
