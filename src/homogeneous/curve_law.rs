//! Laws as fits to curves see them: Ogden's terms and the laws in the first invariant behind one trait.
//!
//! A fit works on unknowns in which its valleys are straight: ln|c| and α of each of Ogden's terms (c = μα keeps its
//! sign), and of a law in the first invariant the logarithm of each parameter that keeps its sign, else the parameter
//! itself. There are as many unknowns as parameters, in the same order.

use super::compressible::respond;
use super::deformation::{Deformation, incompressible_derivative, incompressible_stress};
use super::fit_options::CurveFitOptions;
use crate::material::{
    InvariantLaw, Lanes, LawParameter, Material, OgdenTerm, Parameter, SECOND_EXPONENT, ShearTerm,
    first_invariant_less_3, initial_shear_modulus_kpa, smallest_relative_stiffness, smallest_relative_stiffness_of_law,
};
use crate::optimise::LinearLimit;
use nalgebra::DMatrix;

/// Largest change of a logarithm or an exponent in one step.
const LARGEST_STEP: f64 = 2.0;
/// Largest change of a coefficient that may have either sign in one step, relative to the initial shear modulus.
const LARGEST_STEP_OF_COEFFICIENTS: f64 = 10.0;
/// A term that carries less than this part of the stress has faded.
const FADED: f64 = 1e-3;

/// A parameter of a law.
#[derive(Clone, Debug, PartialEq)]
pub struct LawValue {
    /// `mu_1`, `alpha_1`, …; of a law in the first invariant as its files call it.
    pub name: String,
    /// Its value.
    pub value: f64,
    /// Whether it is held.
    pub held: bool,
}

/// A law of the change of shape, which curves are fitted with.
pub trait CurveLaw {
    /// The material of this law with κ, kPa.
    fn material(&self, bulk_kpa: f64) -> Material;

    /// Nominal stress (kPa) of the incompressible material along the test's axis; not a number beyond the states that
    /// the law allows.
    fn incompressible_stress(&self, state: &Deformation) -> f64;

    /// The initial shear modulus, kPa.
    fn initial_shear_modulus_kpa(&self) -> f64;

    /// The smallest stiffness of a state with traceless log stretches over all increments, relative to the initial
    /// shear modulus: 2 at rest, negative where the material is unstable.
    fn smallest_relative_stiffness(&self, log_stretches: [f64; 3]) -> f64;

    /// Whether the material is stable in all states for its parameters alone.
    fn is_always_stable(&self) -> bool;

    /// Its parameters.
    fn parameters(&self) -> Vec<LawValue>;

    /// Its unknowns.
    fn unknowns(&self) -> Vec<f64>;

    /// The law with other unknowns.
    fn with_unknowns(&self, unknowns: &[f64]) -> Self
    where
        Self: Sized;

    /// Limits of the unknowns.
    fn limits(&self, options: &CurveFitOptions) -> Vec<LinearLimit>;

    /// Whether it says something of a fit that a limit is reached.
    fn is_told_by(&self, limit: &LinearLimit) -> bool;

    /// Largest change of each unknown in one step.
    fn largest_steps(&self) -> Vec<f64>;

    /// The nominal stress in a state (kPa), of `material` where there is one, else of the incompressible limit; puts
    /// `weight` times its derivatives by the unknowns into `row`. `None` where the state has no response.
    fn stress_and_row(
        &self,
        material: Option<&Material>,
        state: &Deformation,
        weight: f64,
        row: &mut [f64],
    ) -> Option<f64>;

    /// ∂(parameter)/∂(unknown).
    fn parameter_map(&self) -> DMatrix<f64>;

    /// ∂(initial shear modulus)/∂(unknown).
    fn modulus_gradient(&self) -> Vec<f64>;

    /// What is degenerate about a fit with this Jacobian.
    fn notes(&self, jacobian: &DMatrix<f64>, is_at_limit: bool) -> Vec<String>;
}

/// Ogden's terms, largest exponent first.
#[derive(Clone, Debug, PartialEq)]
pub struct OgdenTerms {
    /// The terms.
    pub terms: Vec<ShearTerm>,
    /// Which of them has its exponent held at 2.
    pub held: Option<usize>,
}

impl OgdenTerms {
    /// Terms of which none is held.
    pub fn free(terms: &[ShearTerm]) -> OgdenTerms {
        OgdenTerms { terms: terms.to_vec(), held: None }
    }
}

impl CurveLaw for OgdenTerms {
    fn material(&self, bulk_kpa: f64) -> Material {
        let terms = self.terms.iter().map(|t| OgdenTerm { mu_kpa: t.mu_kpa(), alpha: t.alpha }).collect();
        Material { bulk_kpa, terms, law: None }
    }

    fn incompressible_stress(&self, state: &Deformation) -> f64 {
        incompressible_stress(&self.terms, state)
    }

    fn initial_shear_modulus_kpa(&self) -> f64 {
        initial_shear_modulus_kpa(&self.terms)
    }

    fn smallest_relative_stiffness(&self, log_stretches: [f64; 3]) -> f64 {
        smallest_relative_stiffness(&self.terms, log_stretches)
    }

    fn is_always_stable(&self) -> bool {
        self.terms.iter().all(|t| t.modulus_kpa > 0.0)
    }

    fn parameters(&self) -> Vec<LawValue> {
        let of_term = |(t, term): (usize, &ShearTerm)| {
            [
                LawValue { name: Parameter::Mu(t).name(), value: term.mu_kpa(), held: false },
                LawValue { name: Parameter::Alpha(t).name(), value: term.alpha, held: self.held == Some(t) },
            ]
        };
        self.terms.iter().enumerate().flat_map(of_term).collect()
    }

    fn unknowns(&self) -> Vec<f64> {
        self.terms.iter().flat_map(|t| [t.modulus_kpa.abs().ln(), t.alpha]).collect()
    }

    fn with_unknowns(&self, x: &[f64]) -> OgdenTerms {
        let moved = |(i, term): (usize, &ShearTerm)| ShearTerm {
            modulus_kpa: term.modulus_kpa.signum() * x[2 * i].exp(),
            alpha: x[2 * i + 1],
        };
        OgdenTerms { terms: self.terms.iter().enumerate().map(moved).collect(), held: self.held }
    }

    fn limits(&self, options: &CurveFitOptions) -> Vec<LinearLimit> {
        let mut limits = Vec::new();
        for i in 0..self.terms.len() {
            limits.push(LinearLimit::at_least(2 * i + 1, options.alpha_range[0]));
            limits.push(LinearLimit::at_most(2 * i + 1, options.alpha_range[1]));
            if i > 0 {
                let coefficients = vec![(2 * i + 1, 1.0), (2 * i - 1, -1.0)];
                limits.push(LinearLimit { coefficients, bound: -options.min_alpha_gap });
            }
        }
        limits
    }

    fn is_told_by(&self, limit: &LinearLimit) -> bool {
        // The held exponent may stand anywhere.
        limit.coefficients.len() > 1 || self.held != Some(limit.coefficients[0].0 / 2)
    }

    fn largest_steps(&self) -> Vec<f64> {
        // A held exponent has no derivative; a step of zero keeps it from drifting by rounding.
        let is_held = |p: usize| p % 2 == 1 && self.held == Some(p / 2);
        (0..2 * self.terms.len()).map(|p| if is_held(p) { 0.0 } else { LARGEST_STEP }).collect()
    }

    fn stress_and_row(
        &self,
        material: Option<&Material>,
        state: &Deformation,
        weight: f64,
        row: &mut [f64],
    ) -> Option<f64> {
        let mut stress = 0.0;
        if let Some(material) = material {
            let response = respond(material, state).ok()?;
            stress = response.nominal_stress_kpa[0];
            for (t, term) in self.terms.iter().enumerate() {
                let by_mu = response.derivatives[1 + 2 * t][0];
                let by_alpha = response.derivatives[2 + 2 * t][0];
                // At fixed α: dμ = dc/α = μ d ln c. At fixed c: dμ = −μ/α dα.
                row[2 * t] = weight * by_mu * term.mu_kpa();
                row[2 * t + 1] = weight * (by_alpha - by_mu * term.mu_kpa() / term.alpha);
            }
        } else {
            for (t, term) in self.terms.iter().enumerate() {
                let [by_c, by_alpha] = incompressible_derivative(term, state);
                stress += by_c * term.modulus_kpa;
                row[2 * t] = weight * by_c * term.modulus_kpa;
                row[2 * t + 1] = weight * by_alpha;
            }
        }
        if let Some(held) = self.held {
            row[2 * held + 1] = 0.0;
        }
        Some(stress)
    }

    fn parameter_map(&self) -> DMatrix<f64> {
        // (ln c, α) → (μ, α): dμ = μ d ln c − μ/α dα.
        let n = 2 * self.terms.len();
        let mut map = DMatrix::identity(n, n);
        for (t, term) in self.terms.iter().enumerate() {
            map[(2 * t, 2 * t)] = term.mu_kpa();
            map[(2 * t, 2 * t + 1)] = -term.mu_kpa() / term.alpha;
        }
        map
    }

    fn modulus_gradient(&self) -> Vec<f64> {
        // ½ Σ c: its gradient in ln c is ½ c.
        self.terms.iter().flat_map(|t| [0.5 * t.modulus_kpa, 0.0]).collect()
    }

    fn notes(&self, jacobian: &DMatrix<f64>, is_at_limit: bool) -> Vec<String> {
        let mut notes = Vec::new();
        // ∂r/∂ln c is the term's own stress in units of the weight.
        let share: Vec<f64> = (0..self.terms.len()).map(|t| jacobian.column(2 * t).norm()).collect();
        let largest = share.iter().fold(0.0f64, |a, b| a.max(*b));
        for (t, s) in share.iter().enumerate() {
            if *s < FADED * largest {
                notes.push(format!("term {} has faded: it carries less than {FADED} of the stress", t + 1));
            }
            let alpha = self.terms[t].alpha;
            if alpha.abs() < 0.05 {
                notes.push(format!(
                    "alpha_{0} is near 0, where mu_{0} grows without limit; mu alpha is the meaningful product",
                    t + 1
                ));
            }
        }
        if is_at_limit {
            notes.push("an exponent stands at the end of its range or at the least distance from its neighbour".into());
        }
        notes
    }
}

/// ∂ξ/∂(unknown) of a parameter of a law in the first invariant.
fn rate(parameter: LawParameter, value: f64) -> f64 {
    if parameter.has_any_sign() { 1.0 } else { value }
}

/// The incompressible stress of an Ogden term with c = 1 kPa: a law in the first invariant has 4 W′ times that of
/// exponent 2.
fn stress_of_unit_term(alpha: f64, state: &Deformation) -> f64 {
    incompressible_derivative(&ShearTerm { modulus_kpa: 1.0, alpha }, state)[0]
}

impl CurveLaw for InvariantLaw {
    fn material(&self, bulk_kpa: f64) -> Material {
        Material { bulk_kpa, terms: Vec::new(), law: Some(*self) }
    }

    fn incompressible_stress(&self, state: &Deformation) -> f64 {
        let first = 4.0 * self.slopes_at(first_invariant_less_3(state.log_stretches()))[0];
        let of_second = |mu_kpa: f64| SECOND_EXPONENT * mu_kpa * stress_of_unit_term(SECOND_EXPONENT, state);
        first * stress_of_unit_term(2.0, state) + self.second_mu_kpa().map_or(0.0, of_second)
    }

    fn initial_shear_modulus_kpa(&self) -> f64 {
        InvariantLaw::initial_shear_modulus_kpa(self)
    }

    fn smallest_relative_stiffness(&self, log_stretches: [f64; 3]) -> f64 {
        smallest_relative_stiffness_of_law(self, log_stretches)
    }

    fn is_always_stable(&self) -> bool {
        false
    }

    fn parameters(&self) -> Vec<LawValue> {
        let of = |p: &LawParameter| LawValue { name: p.name(), value: self.value(*p), held: false };
        InvariantLaw::parameters(self).iter().map(of).collect()
    }

    fn unknowns(&self) -> Vec<f64> {
        let of = |p: &LawParameter| if p.has_any_sign() { self.value(*p) } else { self.value(*p).ln() };
        InvariantLaw::parameters(self).iter().map(of).collect()
    }

    fn with_unknowns(&self, unknowns: &[f64]) -> InvariantLaw {
        let mut moved = *self;
        for (parameter, x) in InvariantLaw::parameters(self).iter().zip(unknowns) {
            moved.set(*parameter, if parameter.has_any_sign() { *x } else { x.exp() });
        }
        moved
    }

    fn limits(&self, _: &CurveFitOptions) -> Vec<LinearLimit> {
        let mut limits = Vec::new();
        for (index, parameter) in InvariantLaw::parameters(self).iter().enumerate() {
            let [low, high] = parameter.range().map(|v| if parameter.has_any_sign() { v } else { v.ln() });
            // The logarithm of a modulus has no lower end.
            if low.is_finite() {
                limits.push(LinearLimit::at_least(index, low));
            }
            limits.push(LinearLimit::at_most(index, high));
        }
        limits
    }

    fn is_told_by(&self, _: &LinearLimit) -> bool {
        true
    }

    fn largest_steps(&self) -> Vec<f64> {
        let of_coefficient = LARGEST_STEP_OF_COEFFICIENTS * CurveLaw::initial_shear_modulus_kpa(self);
        let of = |p: &LawParameter| if p.has_any_sign() { of_coefficient } else { LARGEST_STEP };
        InvariantLaw::parameters(self).iter().map(of).collect()
    }

    fn stress_and_row(
        &self,
        material: Option<&Material>,
        state: &Deformation,
        weight: f64,
        row: &mut [f64],
    ) -> Option<f64> {
        let parameters = InvariantLaw::parameters(self);
        let rate = |p: LawParameter| rate(p, self.value(p));
        let stress = if let Some(material) = material {
            let response = respond(material, state).ok()?;
            for (index, p) in parameters.iter().enumerate() {
                // κ comes first.
                row[index] = weight * response.derivatives[1 + index][0] * rate(*p);
            }
            response.nominal_stress_kpa[0]
        } else {
            let x = first_invariant_less_3(state.log_stretches());
            let unit = stress_of_unit_term(2.0, state);
            let second_unit = SECOND_EXPONENT * stress_of_unit_term(SECOND_EXPONENT, state);
            for (index, p) in parameters.iter().enumerate() {
                let first = 4.0 * self.slope_derivative(*p, Lanes::splat(x)).0[0] * unit;
                row[index] = weight * (first + self.second_mu_derivative(*p) * second_unit) * rate(*p);
            }
            self.incompressible_stress(state)
        };
        stress.is_finite().then_some(stress)
    }

    fn parameter_map(&self) -> DMatrix<f64> {
        let parameters = InvariantLaw::parameters(self);
        let rates = parameters.iter().map(|p| rate(*p, self.value(*p)));
        DMatrix::from_diagonal(&nalgebra::DVector::from_iterator(parameters.len(), rates))
    }

    fn modulus_gradient(&self) -> Vec<f64> {
        let by_parameter = self.material(1.0).initial_shear_modulus_derivatives();
        let parameters = InvariantLaw::parameters(self).iter();
        // κ comes first.
        parameters.zip(&by_parameter[1..]).map(|(p, d)| d * rate(*p, self.value(*p))).collect()
    }

    fn notes(&self, _: &DMatrix<f64>, is_at_limit: bool) -> Vec<String> {
        let name = self.kind().name();
        if is_at_limit {
            vec![format!("a parameter of the law of {name} stands at the end of its range")]
        } else {
            Vec::new()
        }
    }
}
