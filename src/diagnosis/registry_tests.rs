use super::*;
use crate::diagnosis::cause::CauseParameter;
use crate::diagnosis::diagnose::diagnose_among;
use crate::diagnosis::options::DiagnosisOptions;
use crate::diagnosis::scene::Scene;
use crate::diagnosis::test_recordings::{FINER_FACTOR, material, options, recorded};

/// A cause as its own file would hold it: its name, its entry, its model.
mod turned_image {
    use crate::diagnosis::cause::{Category, Cause, CauseName, CauseParameter};
    use crate::diagnosis::entry::{Entry, Origin};
    use crate::diagnosis::scene::Scene;
    use std::sync::Arc;

    pub(super) const NAME: CauseName = CauseName::new("turned_image");
    pub(super) const ENTRY: Entry =
        Entry { name: NAME, remedy: "Turn it back.", origin: Origin::Tested(|_| vec![Arc::new(TurnedImage)]) };

    /// The image is turned about y.
    struct TurnedImage;

    impl Cause for TurnedImage {
        fn name(&self) -> CauseName {
            NAME
        }

        fn category(&self) -> Category {
            Category::Acquisition
        }

        fn description(&self) -> String {
            "the image is turned about y".into()
        }

        fn parameters(&self) -> Vec<CauseParameter> {
            vec![CauseParameter::new("degrees_about_y", 0.5, [-20.0, 20.0])]
        }

        fn apply(&self, values: &[f64], scene: &mut Scene) {
            scene.image.pose.rotation_rad[1] += values[0].to_radians();
        }

        fn changes_sample(&self) -> bool {
            false
        }
    }
}

/// The one line that registers the cause above beside all others.
fn with_turned_image() -> Registry {
    Registry { entries: [REGISTRY, &[turned_image::ENTRY]].concat(), own: Vec::new() }
}

/// A cause of a program's own, with the name, scale, range and start that a test asks for.
struct Own {
    name: &'static str,
    category: Category,
    scale: f64,
    range: [f64; 2],
    start: Vec<f64>,
}

impl Cause for Own {
    fn name(&self) -> CauseName {
        CauseName::new(self.name)
    }

    fn category(&self) -> Category {
        self.category
    }

    fn description(&self) -> String {
        "the sample is stiffer at its rim".into()
    }

    fn parameters(&self) -> Vec<CauseParameter> {
        vec![CauseParameter::new("log_rim", self.scale, self.range)]
    }

    fn start(&self) -> Vec<f64> {
        self.start.clone()
    }

    fn apply(&self, _values: &[f64], _scene: &mut Scene) {}
}

fn own(name: &'static str, category: Category) -> Own {
    Own { name, category, scale: 0.1, range: [-1.0, 1.0], start: vec![0.0] }
}

/// A cause of one's own is tested, left out and set aside with the rest of its kind.
#[test]
fn own_causes_stand_beside_the_others() {
    let name = CauseName::new("rim");
    let with = |category| Registry::standard().with(Arc::new(own("rim", category))).unwrap();
    let specimen = Specimen::from_json(include_str!("../../geometries/solid-shear.json")).unwrap();
    let num_tested = |registry: &Registry| registry.tested(&specimen).iter().filter(|c| c.name() == name).count();
    for (category, at_boundary, inside) in
        [(Category::Boundary, 1, 0), (Category::Material, 0, 1), (Category::Geometry, 1, 1)]
    {
        let registry = with(category);
        assert_eq!((registry.names().last(), num_tested(&registry)), (Some(&name), 1));
        assert_eq!(num_tested(&registry.clone().without_inside()), at_boundary, "{category:?}");
        assert_eq!(num_tested(&registry.clone().without_boundary()), inside, "{category:?}");
        assert_eq!(num_tested(&registry.clone().of_image_alone(&specimen)), 0);
        assert_eq!(num_tested(&registry.without(&[name]).unwrap()), 0);
    }
}

/// What a fit could not use is refused with the cause's name and what to change.
#[test]
fn own_causes_that_cannot_be_fitted_are_refused() {
    let refused = |registry: Registry, cause: Own| registry.with(Arc::new(cause)).map(|_| ()).unwrap_err().to_string();
    let rim = || own("rim", Category::Material);
    let with_rim = Registry::standard().with(Arc::new(rim())).unwrap();
    for (message, part) in [
        (refused(Registry::standard(), own("swelling", Category::Material)), "comes with the program"),
        (refused(with_rim, rim()), "another variant"),
        (refused(Registry::standard(), Own { scale: f64::NAN, ..rim() }), "the scale of log_rim is NaN"),
        (refused(Registry::standard(), Own { range: [1.0, -1.0], ..rim() }), "log_rim starts from 0"),
        (refused(Registry::standard(), Own { start: vec![2.0], ..rim() }), "log_rim starts from 2"),
        (refused(Registry::standard(), Own { start: vec![], ..rim() }), "1 parameters and 0 values"),
    ] {
        assert!(message.contains(part), "{message}");
    }
}

/// One file and one line: the diagnosis tests, ranks, fits, names and measures a cause that it never heard of.
#[test]
fn a_new_cause_is_an_entry() {
    let mut scene = Scene::default();
    scene.image.pose.rotation_rad[1] = 3f64.to_radians();
    let recording = recorded(&material(), &scene, FINER_FACTOR);
    let options = DiagnosisOptions { max_causes: 1, ..options() };
    let found = diagnose_among(&with_turned_image(), &recording, &options, &|_| {}, &|| false).unwrap();
    let ranked = found.ranked.iter().find(|r| r.identity.name == turned_image::NAME).unwrap();
    assert!(ranked.score > 100.0 && ranked.fitted.is_some(), "{ranked:?}");
    // The registration of the registry turns about y too, with five more parameters to pay for.
    let cause = &found.causes[0];
    assert_eq!(cause.name, turned_image::NAME, "{:?}", found.ranked);
    let (name, degrees, _) = &cause.parameters[0];
    // Three degrees of 4 mm are 0.2 mm in hundreds of voxels, with 0.01 mm of noise and an allowance of 0.005 mm.
    assert!(name == "degrees_about_y" && (degrees - 3.0).abs() < 0.15, "{degrees}");
    // Without that line it is not known.
    assert!(!cause_names().contains(&turned_image::NAME));
}

/// The names that results may hold, as the exchange format lists them.
#[test]
fn names_are_those_of_the_format() {
    let mut names: Vec<&str> = cause_names().into_iter().map(CauseName::as_str).collect();
    names.sort_unstable();
    let expected = [
        "background",
        "bond",
        "cell",
        "compliance",
        "compressibility",
        "cut",
        "debond",
        "fibre",
        "gain",
        "gradient",
        "hole",
        "inclusion",
        "law",
        "layer",
        "mount",
        "mullins",
        "offaxis",
        "outline",
        "registration",
        "relaxation",
        "slack",
        "swelling",
        "terms",
        "tilt",
        "travel",
        "wrap",
    ];
    assert_eq!(names, expected);
}

/// All ways to suspect a cause that is left out go with it; a name that is none is an error which lists the names.
#[test]
fn causes_are_left_out_by_name() {
    let cell = CauseName::new("cell");
    let all = Registry::standard();
    let left = all.clone().without(&[cell]).unwrap();
    assert_eq!(all.load_effects().len() - left.load_effects().len(), 2);
    assert!(left.load_effects().iter().all(|e| e.name() != cell));
    // A cause that holds the one left out as a special case would find it again under its own name.
    assert_eq!(all.special_cases(&[]), []);
    let left = all.clone().without(&[CauseName::new("tilt")]).unwrap();
    assert_eq!(all.names().len() - left.names().len(), 2);
    assert!(!left.names().contains(&CauseName::new("travel")));
    let error = all.without(&[CauseName::new("tlit")]).map(|_| ()).unwrap_err().to_string();
    assert!(error.contains("'tlit'") && error.contains("tilt"), "{error}");
}

/// Entries and what they hold go by one name.
#[test]
fn entries_are_named_as_what_they_hold() {
    let mut specimen = Specimen::from_json(include_str!("../../geometries/two-hole-shear.json")).unwrap();
    specimen.drive_mm = vec![1.0, 2.0];
    for entry in REGISTRY {
        match entry.origin {
            Origin::Tested(suspects) => assert!(suspects(&specimen).iter().all(|c| c.name() == entry.name)),
            Origin::LoadCurve(effect) => assert_eq!(effect.name(), entry.name),
            Origin::Material(cause) => assert_eq!(cause.name(), entry.name),
            Origin::Searched(_) | Origin::LookAlike | Origin::Artefact { .. } | Origin::SetUp { .. } => {}
        }
    }
    // Holes are suspects of one name and different identities.
    let suspects = Registry::standard().tested(&specimen);
    for (n, a) in suspects.iter().enumerate() {
        assert!(suspects[..n].iter().all(|b| a.identity() != b.identity()), "{}", a.description());
    }
}
