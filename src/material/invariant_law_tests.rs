use super::*;
use crate::material::{
    Material, OgdenTerm, Parameter, energy_density, first_piola_kirchhoff_stress, least_relative_stiffness,
    material_tangent, smallest_relative_stiffness, smallest_relative_stiffness_of_law, stress_parameter_derivative,
};

/// One of each law. Those that can stiffen do so within the states of the tests.
pub(crate) fn laws() -> [InvariantLaw; 5] {
    [
        InvariantLaw::Yeoh(Yeoh { coefficients_kpa: [8.0, -0.3, 0.05] }),
        InvariantLaw::Gent(Gent { mu_kpa: 16.0, limit: 9.0 }),
        InvariantLaw::ArrudaBoyce(ArrudaBoyce { mu_kpa: 15.0, locking_stretch: 1.8 }),
        InvariantLaw::NeoHookean(NeoHookean { mu_kpa: 16.0 }),
        InvariantLaw::MooneyRivlin(MooneyRivlin { coefficients_kpa: [6.0, 2.0] }),
    ]
}

/// Central differences of step h: truncation h² times third derivatives (below 100 kPa here), rounding 1e-13/h.
#[test]
fn slopes_are_derivatives_of_the_energy() {
    let h = 1e-5;
    for law in laws() {
        for x in [1e-3, 0.2, 1.5, 4.0] {
            let [slope, second] = law.slopes_at(x);
            let rise = (law.energy_density(x + h) - law.energy_density(x - h)) / (2.0 * h);
            assert!((rise - slope).abs() < 1e-7 * (1.0 + slope.abs()), "{law:?} {x}: {rise} {slope}");
            let bend = (law.slopes_at(x + h)[0] - law.slopes_at(x - h)[0]) / (2.0 * h);
            assert!((bend - second).abs() < 1e-7 * (1.0 + second.abs()), "{law:?} {x}: {bend} {second}");
        }
        assert_eq!(law.energy_density(0.0), 0.0);
    }
}

/// As above, of the slope by each parameter.
#[test]
fn slope_derivatives_match_differences() {
    for law in laws() {
        for parameter in law.parameters() {
            for x in [0.0, 0.7, 3.0] {
                let value = law.value(*parameter);
                let h = 1e-5 * value.abs();
                let at = |value: f64| {
                    let mut moved = law;
                    moved.set(*parameter, value);
                    moved.slopes_at(x)[0]
                };
                let difference = (at(value + h) - at(value - h)) / (2.0 * h);
                let derivative = law.slope_derivative(*parameter, Lanes::splat(x)).0[0];
                assert!(
                    (difference - derivative).abs() < 1e-7 * (1.0 + derivative.abs()),
                    "{law:?} {parameter:?} {x}: {difference} {derivative}"
                );
            }
        }
    }
}

/// Without its stiffening each law is the neo-Hookean one, an Ogden term of exponent 2: to the order of 1/J_m, 1/λ_m².
#[test]
fn limits_are_neo_hookean() {
    let ogden = Material { bulk_kpa: 900.0, terms: vec![OgdenTerm { mu_kpa: 16.0, alpha: 2.0 }], law: None };
    let f = [[1.3, 0.4, 0.0], [0.0, 0.9, 0.1], [0.0, -0.2, 1.0]];
    let wanted = first_piola_kirchhoff_stress(&ogden, &f);
    let almost = [
        (InvariantLaw::NeoHookean(NeoHookean { mu_kpa: 16.0 }), 1e-13),
        (InvariantLaw::MooneyRivlin(MooneyRivlin { coefficients_kpa: [8.0, 0.0] }), 1e-13),
        (InvariantLaw::Yeoh(Yeoh { coefficients_kpa: [8.0, 0.0, 0.0] }), 1e-13),
        (InvariantLaw::Gent(Gent { mu_kpa: 16.0, limit: 1e6 }), 1e-6),
        (InvariantLaw::ArrudaBoyce(ArrudaBoyce { mu_kpa: 16.0, locking_stretch: 1e3 }), 1e-5),
    ];
    for (law, tolerance) in almost {
        let material = Material { bulk_kpa: 900.0, terms: vec![], law: Some(law) };
        let found = first_piola_kirchhoff_stress(&material, &f);
        for (a, b) in found.iter().flatten().zip(wanted.iter().flatten()) {
            assert!((a - b).abs() < tolerance * 100.0, "{law:?}: {a} {b}");
        }
    }
}

/// Mooney and Rivlin's law is two Ogden terms of exponents 2 and −2, in everything that follows from it: the same
/// numbers but for rounding. So it is where c₂ is zero, whose derivative is not.
#[test]
fn mooney_rivlin_is_two_terms() {
    let f = [[1.3, 0.4, 0.0], [0.0, 0.9, 0.1], [0.0, -0.2, 1.0]];
    let traceless = [0.4, -0.1, -0.3];
    for [c_1, c_2] in [[6.0, 2.0], [9.0, -1.5], [8.0, 0.0]] {
        let law = InvariantLaw::MooneyRivlin(MooneyRivlin { coefficients_kpa: [c_1, c_2] });
        let own = Material { bulk_kpa: 900.0, terms: vec![], law: Some(law) };
        // A term of no modulus has derivatives, too.
        let terms = [(2.0 * c_1, 2.0), (-2.0 * c_2, -2.0)].map(|(mu_kpa, alpha)| OgdenTerm { mu_kpa, alpha });
        let ogden = Material { bulk_kpa: 900.0, terms: terms.to_vec(), law: None };
        let near = |a: f64, b: f64, scale: f64| assert!((a - b).abs() < 1e-12 * scale, "{c_2}: {a} {b}");
        near(energy_density(&own, [1.4, 0.8, 0.9]), energy_density(&ogden, [1.4, 0.8, 0.9]), 10.0);
        near(own.initial_shear_modulus_kpa(), ogden.initial_shear_modulus_kpa(), 10.0);
        let pairs = [(&own, &ogden)].map(|(a, b)| {
            let stresses = [a, b].map(|m| first_piola_kirchhoff_stress(m, &f).as_flattened().to_vec());
            let tangents = [a, b].map(|m| material_tangent(m, &f).as_flattened().to_vec());
            [stresses, tangents]
        });
        for [a, b] in pairs.as_flattened() {
            a.iter().zip(b).for_each(|(a, b)| near(*a, *b, 1e3));
        }
        for (parameter, term, rate) in [(0, 0, 2.0), (1, 1, -2.0)] {
            if c_2 == 0.0 && term == 1 {
                // Ogden's derivative by μ divides by μ.
                continue;
            }
            let law_parameter = Parameter::Law(LawParameter::Coefficient(parameter));
            let a = stress_parameter_derivative(&own, law_parameter, &f);
            let b = stress_parameter_derivative(&ogden, Parameter::Mu(term), &f);
            a.iter().flatten().zip(b.iter().flatten()).for_each(|(a, b)| near(*a, rate * b, 10.0));
        }
        let terms = ogden.shear_terms();
        let stiffnesses =
            [smallest_relative_stiffness_of_law(&law, traceless), smallest_relative_stiffness(&terms, traceless)];
        near(stiffnesses[0], stiffnesses[1], 10.0);
    }
    // By the second coefficient where it is zero: a difference of first order in it is exact.
    let at = |c_2: f64| Material {
        bulk_kpa: 900.0,
        terms: vec![],
        law: Some(InvariantLaw::MooneyRivlin(MooneyRivlin { coefficients_kpa: [8.0, c_2] })),
    };
    let derivative = stress_parameter_derivative(&at(0.0), Parameter::Law(LawParameter::Coefficient(1)), &f);
    let [low, high] = [at(0.0), at(1.0)].map(|m| first_piola_kirchhoff_stress(&m, &f));
    for (d, (a, b)) in derivative.iter().flatten().zip(low.iter().flatten().zip(high.iter().flatten())) {
        assert!((b - a - d).abs() < 1e-11, "{d} {}", b - a);
    }
}

/// Gent's closed form in uniaxial tension of an incompressible sample, σ = μ J_m/(J_m − x) (λ² − 1/λ), and nothing
/// beyond the end of the chains.
#[test]
fn gent_in_tension() {
    let law = Gent { mu_kpa: 16.0, limit: 9.0 };
    let material = Material { bulk_kpa: 1.0, terms: vec![], law: Some(InvariantLaw::Gent(law)) };
    let l: f64 = 2.5;
    let lateral = l.powf(-0.5);
    let f = [[l, 0.0, 0.0], [0.0, lateral, 0.0], [0.0, 0.0, lateral]];
    let p = first_piola_kirchhoff_stress(&material, &f);
    let cauchy = p[0][0] * l - p[2][2] * lateral;
    let x = l * l + 2.0 / l - 3.0;
    let wanted = 16.0 * 9.0 / (9.0 - x) * (l * l - 1.0 / l);
    // Rounding of sums of a few terms.
    assert!((cauchy - wanted).abs() < 1e-11 * wanted, "{cauchy} {wanted}");
    assert!(law.slopes(Lanes::splat(9.1))[0].0[0].is_nan());
    assert_eq!(energy_density(&material, [5.0, 0.2f64.sqrt(), 0.2f64.sqrt()]), f64::INFINITY);
}

/// Arruda and Boyce's initial shear modulus, μ (1 + 3/(5 λ²) + 99/(175 λ⁴) + 513/(875 λ⁶) + 42039/(67375 λ⁸)).
#[test]
fn arruda_boyce_at_rest() {
    let law = ArrudaBoyce { mu_kpa: 15.0, locking_stretch: 1.8 };
    let q = 1.8f64.powi(-2);
    let series = 1.0 + q * (3.0 / 5.0 + q * (99.0 / 175.0 + q * (513.0 / 875.0 + q * (42_039.0 / 67_375.0))));
    let found = InvariantLaw::ArrudaBoyce(law).initial_shear_modulus_kpa();
    assert!((found - 15.0 * series).abs() < 1e-12 * found, "{found} {}", 15.0 * series);
}

/// Laws that stiffen are stable; a softening one is not, beyond the x at which its slope falls too fast.
#[test]
fn stability_follows_the_slopes() {
    let visited = [[1.6, 1.0, 0.625], [2.0, 0.5f64.sqrt(), 0.5f64.sqrt()]];
    for law in laws() {
        assert!(least_relative_stiffness(&Material { bulk_kpa: 1.0, terms: vec![], law: Some(law) }, &visited) > 0.0);
    }
    let softening = InvariantLaw::Yeoh(Yeoh { coefficients_kpa: [8.0, -2.5, 0.0] });
    let material = Material { bulk_kpa: 1.0, terms: vec![], law: Some(softening) };
    assert!(least_relative_stiffness(&material, &visited) < 0.0);
    let ended = InvariantLaw::Gent(Gent { mu_kpa: 16.0, limit: 1.5 });
    let material = Material { bulk_kpa: 1.0, terms: vec![], law: Some(ended) };
    assert_eq!(least_relative_stiffness(&material, &visited), f64::NEG_INFINITY);
}
