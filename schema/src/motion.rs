//! placeholder until the exact routine lands
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Motion { pub x: f64, pub y: f64, pub theta: f64, pub v: f64, pub omega: f64, pub path: f64 }
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wheels { pub v0l: f64, pub v0r: f64, pub v1l: f64, pub v1r: f64, pub duration: f64, pub track: f64 }
impl Wheels {
    pub fn at(&self, t: f64) -> Motion {
        let t = t.clamp(0.0, self.duration);
        let n = 200; let h = t / n as f64;
        let (mut x, mut y) = (0.0, 0.0);
        let f = |s: f64| if self.duration > 0.0 { s / self.duration } else { 0.0 };
        let vl = |s: f64| self.v0l + (self.v1l - self.v0l) * f(s);
        let vr = |s: f64| self.v0r + (self.v1r - self.v0r) * f(s);
        let th = |s: f64| ((self.v0r + vr(s)) / 2.0 * s - (self.v0l + vl(s)) / 2.0 * s) / self.track;
        for i in 0..n { let m = (i as f64 + 0.5) * h; let v = (vl(m) + vr(m)) / 2.0; x += v * th(m).cos() * h; y += v * th(m).sin() * h; }
        Motion { x, y, theta: th(t), v: (vl(t) + vr(t)) / 2.0, omega: (vr(t) - vl(t)) / self.track, path: 0.0 }
    }
    pub fn end(&self) -> Motion { self.at(self.duration) }
}
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape { Rest, Line, Spin, Circle, Spiral, Clothoid }
pub fn shape(_w: &Wheels) -> Shape { Shape::Clothoid }
pub fn arc(left: f64, right: f64, track: f64) -> (f64, f64, f64) {
    let th = (right - left) / track; let s = (left + right) / 2.0; let z = th / 2.0;
    let c = if z.abs() > 0.0 { s * z.sin() / z } else { s };
    (c * z.cos(), c * z.sin(), th)
}
