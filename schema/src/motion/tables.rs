//! The coefficients of the exact motion routine.
//!
//! They were computed for this project in multiple precision and rounded once to `f64`; each is printed with
//! the fewest digits that give the same `f64` back. Polynomials have their lowest power first. The tests at
//! the end compare every table with its definition by independent means.

/// A Gauss–Legendre rule on [−1, 1] with `2N` nodes, of which only the positive ones are kept: the others
/// mirror them.
pub(super) struct Rule<const N: usize> {
    /// Positive nodes, from the outermost inwards.
    pub(super) nodes: [f64; N],
    /// Weight of each node.
    pub(super) weights: [f64; N],
}

/// Polynomials for the sine and the cosine: `sin x = x·P(x²)`, `cos x = Q(x²)`.
pub(super) struct Waves<const S: usize, const C: usize> {
    /// The coefficients of `P`.
    pub(super) sin: [f64; S],
    /// The coefficients of `Q`.
    pub(super) cos: [f64; C],
}

/// Sine and cosine for `|x| ≤ 0.2`: Taylor's series. Truncation error below 1e-17.
pub(super) const RIPPLES: Waves<6, 6> = Waves {
    sin: [
        1.0,
        -0.16666666666666666,
        0.008333333333333333,
        -0.0001984126984126984,
        2.7557319223985893e-06,
        -2.505210838544172e-08,
    ],
    cos: [
        1.0,
        -0.5,
        0.041666666666666664,
        -0.001388888888888889,
        2.48015873015873e-05,
        -2.755731922398589e-07,
    ],
};

/// Sine and cosine for `|x| ≤ 0.27`: one more term. Truncation error below 1e-17. Each row is a coefficient of the sine and
/// one of the cosine, since they are wanted of one angle.
pub(super) const SWELL: [[f64; 2]; 7] = [
    [1.0, 1.0],
    [-0.16666666666666666, -0.5],
    [0.008333333333333333, 0.041666666666666664],
    [-0.0001984126984126984, -0.001388888888888889],
    [2.7557319223985893e-06, 2.48015873015873e-05],
    [-2.505210838544172e-08, -2.755731922398589e-07],
    [1.6059043836821613e-10, 2.08767569878681e-09],
];

/// Sine and cosine for `|x| ≤ 1.6`: nearly minimax. Truncation error below 5e-17.
pub(super) const ROLLERS: Waves<9, 9> = Waves {
    sin: [
        1.0,
        -0.16666666666666666,
        0.008333333333333144,
        -0.00019841269841193673,
        2.755731920867262e-06,
        -2.5052106655519892e-08,
        1.6058928978557088e-10,
        -7.642714421438495e-13,
        2.7182632792857447e-15,
    ],
    cos: [
        1.0,
        -0.49999999999999967,
        0.04166666666666307,
        -0.001388888888874459,
        2.480158727257423e-05,
        -2.7557315946039396e-07,
        2.0876539311134135e-09,
        -1.1462310961053394e-11,
        4.6027072507821317e-14,
    ],
};

/// Sine and cosine for `|x| ≤ π`: nearly minimax. Truncation error below 2e-16.
pub(super) const WAVES: Waves<11, 12> = Waves {
    sin: [
        1.0,
        -0.16666666666666663,
        0.008333333333333188,
        -0.00019841269841246783,
        2.755731922211601e-06,
        -2.5052108296950974e-08,
        1.6059041224641872e-10,
        -7.64711416488104e-13,
        2.810852034078537e-15,
        -8.174590315090379e-18,
        1.757612162059121e-20,
    ],
    cos: [
        1.0,
        -0.5,
        0.041666666666666644,
        -0.0013888888888888486,
        2.4801587301547986e-05,
        -2.755731922171865e-07,
        2.087675690495847e-09,
        -1.1470743600805819e-11,
        4.779445217224935e-14,
        -1.5615789764891997e-16,
        4.0871794278811453e-19,
        -7.988983077248857e-22,
    ],
};

/// The Fresnel integral near the inflection, `M(φ) = (1/u)·∫₀ᵘ exp(iCs²) ds` with `φ = Cu²`, for `0 ≤ φ ≤ 6`.
///
/// With `r = φ/6`, `Re M = P(2r²−1)` and `Im M = r·Q(2r²−1)`; each row holds the coefficients of `P` and of
/// `Q`. Error below 3e-17.
pub(super) const NEAR: [[f64; 2]; 14] = [
    [0.2078916771878546, 0.5185742280672195],
    [-0.16513838362005176, -0.7041879554532968],
    [0.3396544530646938, 0.5252305856377231],
    [-0.20927390210656466, -0.1995514691737954],
    [0.06431883258879284, 0.04498601749807727],
    [-0.012042962244764444, -0.006701004950199674],
    [0.0015286640459069903, 0.0007090353837278468],
    [-0.0001407155352451258, -5.608384958534405e-05],
    [9.843046018642744e-06, 3.4439492226900136e-06],
    [-5.415787909873527e-07, -1.690198448580177e-07],
    [2.4070686147927508e-08, 6.783841671617866e-09],
    [-8.826883303932703e-10, -2.2687721455536677e-10],
    [2.7228194441474623e-11, 6.432542481067247e-12],
    [-7.134915234198515e-13, -1.5603321457957266e-13],
];

/// The auxiliary function of the Fresnel integral far from the inflection, for `φ = Cu² ≥ 6`.
///
/// It is the `σ` of `∫ᵤ^∞ exp(iCs²) ds = −exp(iφ)/(2iCu)·(1 + σ/(2iφ))`, so `σ → 1` for `φ → ∞`. With `z =
/// 12/φ − 1`, `σ = P(z) + i·Q(z)`; each row holds the coefficients of `P` and of `Q`. Error below 2e-16, and
/// `σ` enters the result with a weight of at most 1/12.
pub(super) const FAR: [[f64; 2]; 25] = [
    [0.9762956919549269, -0.11841216169711868],
    [-0.043497597566965696, -0.10683345399519473],
    [-0.01510024925280923, 0.014782080362627965],
    [0.004803466818723665, 0.0015264006528881097],
    [-0.0003729841490228139, -0.0013859210851650296],
    [-0.00028823964771400654, 0.0003643275287846691],
    [0.00016570643420109506, -4.346061303060145e-06],
    [-4.4475224749539655e-05, -4.5854450118498516e-05],
    [-3.976888237184873e-07, 2.620450212831517e-05],
    [7.838503887847478e-06, -8.175009910550982e-06],
    [-5.095126981015039e-06, 4.541546452723162e-07],
    [1.9801415515107888e-06, 1.3500855926538375e-06],
    [-3.5396489601583253e-07, -1.1045188228700795e-06],
    [-1.8734373466105024e-07, 5.657617847384607e-07],
    [2.494362199786007e-07, -1.872322944025927e-07],
    [-1.6562099286004054e-07, -3.217699761316852e-08],
    [6.034552435156958e-08, 7.505385045232427e-08],
    [-2.4785499641090996e-09, 4.878158398648737e-09],
    [6.783842786265417e-09, -1.4057256219769235e-08],
    [-1.054158125434801e-08, -5.112337742224199e-08],
    [-1.2250685999302206e-08, 3.677725798387098e-08],
    [1.875181409531423e-08, 1.9986812345854625e-08],
    [-2.9599141121387407e-09, -1.889749329589103e-08],
    [-4.530970248854841e-09, -1.965738076909547e-09],
    [1.6991366764011877e-09, 2.871627434038182e-09],
];

/// Gauss–Legendre rule with 8 nodes on [−1, 1]: the positive nodes and their weights, which add up to 1.
pub(super) const GAUSS_8: Rule<4> = Rule {
    nodes: [0.9602898564975363, 0.7966664774136267, 0.525532409916329, 0.1834346424956498],
    weights: [0.10122853629037626, 0.22238103445337448, 0.31370664587788727, 0.362683783378362],
};

/// Gauss–Legendre rule with 12 nodes on [−1, 1]: the positive nodes and their weights, which add up to 1.
pub(super) const GAUSS_12: Rule<6> = Rule {
    nodes: [
        0.9815606342467192,
        0.9041172563704749,
        0.7699026741943047,
        0.5873179542866175,
        0.3678314989981802,
        0.1252334085114689,
    ],
    weights: [
        0.04717533638651183,
        0.10693932599531843,
        0.16007832854334622,
        0.20316742672306592,
        0.2334925365383548,
        0.24914704581340277,
    ],
};

/// Gauss–Legendre rule with 16 nodes on [−1, 1]: the positive nodes and their weights, which add up to 1.
pub(super) const GAUSS_16: Rule<8> = Rule {
    nodes: [
        0.9894009349916499,
        0.9445750230732326,
        0.8656312023878318,
        0.755404408355003,
        0.6178762444026438,
        0.45801677765722737,
        0.2816035507792589,
        0.09501250983763744,
    ],
    weights: [
        0.027152459411754096,
        0.062253523938647894,
        0.09515851168249279,
        0.12462897125553388,
        0.14959598881657674,
        0.16915651939500254,
        0.18260341504492358,
        0.1894506104550685,
    ],
};

#[cfg(test)]
mod tests {
    use super::{FAR, GAUSS_8, GAUSS_12, GAUSS_16, NEAR, RIPPLES, ROLLERS, Rule, SWELL, WAVES, Waves};
    use std::f64::consts::PI;

    fn horner(coefficients: impl DoubleEndedIterator<Item = f64>, x: f64) -> f64 {
        coefficients.rev().fold(0.0, |sum, coefficient| sum * x + coefficient)
    }

    /// Real and imaginary part of a table of two columns.
    fn columns(rows: &[[f64; 2]], x: f64) -> (f64, f64) {
        (horner(rows.iter().map(|row| row[0]), x), horner(rows.iter().map(|row| row[1]), x))
    }

    /// `∫₀¹ exp(iφs²) ds` by brute force.
    fn fresnel(phi: f64) -> (f64, f64) {
        let panels = (phi / 2.0).ceil().max(1.0);
        let (mut re, mut im) = (0.0, 0.0);
        for panel in 0..panels as u32 {
            for (node, weight) in GAUSS_16.nodes.iter().zip(GAUSS_16.weights) {
                for x in [*node, -node] {
                    let s = (f64::from(panel) + (1.0 + x) / 2.0) / panels;
                    let (sin, cos) = (phi * s * s).sin_cos();
                    re += weight / 2.0 / panels * cos;
                    im += weight / 2.0 / panels * sin;
                }
            }
        }
        (re, im)
    }

    #[test]
    fn the_rules_integrate_all_powers_up_to_their_degree() {
        fn check<const N: usize>(rule: &Rule<N>) {
            for power in (0..4 * N).step_by(2) {
                let terms = rule.nodes.iter().zip(rule.weights).map(|(x, w)| w * x.powi(power as i32));
                let error = terms.sum::<f64>() - 1.0 / (power as f64 + 1.0);
                assert!(error.abs() < 3e-16, "{} nodes, power {power}: {error:e}", 2 * N);
            }
        }
        check(&GAUSS_8);
        check(&GAUSS_12);
        check(&GAUSS_16);
    }

    #[test]
    fn sine_and_cosine_are_those_of_the_library() {
        fn check<const S: usize, const C: usize>(waves: &Waves<S, C>, limit: f64, tolerance: f64) {
            for k in -1000..=1000 {
                let x = limit * f64::from(k) / 1000.0;
                let sin = x * horner(waves.sin.into_iter(), x * x) - x.sin();
                let cos = horner(waves.cos.into_iter(), x * x) - x.cos();
                assert!(sin.abs() < tolerance && cos.abs() < tolerance, "{x}: {sin:e}, {cos:e}");
            }
        }
        check(&RIPPLES, 0.2, 1.2e-16);
        check(&Waves { sin: SWELL.map(|row| row[0]), cos: SWELL.map(|row| row[1]) }, 0.27, 1.8e-16);
        check(&ROLLERS, 1.6, 4e-16);
        check(&WAVES, PI, 8e-16);
    }

    #[test]
    fn near_the_inflection_the_fresnel_integral_is_that_of_quadrature() {
        for k in 0..=600 {
            let phi = f64::from(k) / 100.0;
            let r = phi / 6.0;
            let (re, im) = columns(&NEAR, 2.0 * r * r - 1.0);
            let expected = fresnel(phi);
            assert!((re - expected.0).abs() < 1e-15 && (r * im - expected.1).abs() < 1e-15, "{phi}");
        }
    }

    #[test]
    fn far_from_the_inflection_the_rest_of_the_fresnel_integral_is_that_of_quadrature() {
        for k in 0..=600 {
            // From φ = 6 to φ = 66, with C = 1 and so u = √φ.
            let phi = 6.0 + f64::from(k * k) / 6000.0;
            let u = phi.sqrt();
            let infinity = (PI / 8.0).sqrt();
            let (re, im) = fresnel(phi);
            let rest = (infinity - u * re, infinity - u * im);

            let (re, im) = columns(&FAR, 12.0 / phi - 1.0);
            // −exp(iφ)/(2iu)·(1 + σ/(2iφ)) = exp(iφ)/(2u)·(i + σ/(2φ))
            let factor = (re / (2.0 * phi) / (2.0 * u), (1.0 + im / (2.0 * phi)) / (2.0 * u));
            let (sin, cos) = phi.sin_cos();
            let found = (cos * factor.0 - sin * factor.1, cos * factor.1 + sin * factor.0);
            let error = (found.0 - rest.0).hypot(found.1 - rest.1);
            // The brute force rounds its phases, of tens of radians.
            assert!(error < 1e-14, "{phi}: {error:e}");
        }
    }
}
