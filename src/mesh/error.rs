//! Why a specimen was not meshed, or a mesh did not pass its check.

/// What a ligament ends at.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum LigamentEnd {
    /// A hole, by its index in the specimen.
    Hole(usize),
    /// The outline of the section.
    Outline,
}

impl std::fmt::Display for LigamentEnd {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            LigamentEnd::Hole(index) => write!(f, "hole {index}"),
            LigamentEnd::Outline => write!(f, "the outline"),
        }
    }
}

/// Why there is no usable mesh.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MeshError {
    /// A length of the specimen or a meshing option is not a finite number in its range.
    #[error("{name} is {value}; it must be finite, at least {minimum:e} and at most {maximum:e}")]
    OutOfRange {
        /// Name of the field.
        name: &'static str,
        /// Its value.
        value: f64,
        /// Smallest value allowed.
        minimum: f64,
        /// Largest value allowed.
        maximum: f64,
    },
    /// The specimen holds several kinds of samples, and this is done of one.
    #[error(
        "the specimen has {count} kinds of samples (other_samples), and this is done of one kind alone; leave out \
         other_samples, or take one sample at a time"
    )]
    UnlikeSamples {
        /// Kinds of samples.
        count: usize,
    },
    /// A hole's centre or diameter is not a usable number.
    #[error(
        "hole {hole} has centre ({}, {}) mm and diameter {diameter_mm} mm; all must be finite and the diameter positive",
        center_mm[0], center_mm[1]
    )]
    InvalidHole {
        /// Index of the hole.
        hole: usize,
        /// Its centre, mm.
        center_mm: [f64; 2],
        /// Its diameter, mm.
        diameter_mm: f64,
    },
    /// A hole that is said to be a notch is none.
    #[error("hole {hole} {problem}")]
    BadNotch {
        /// Index of the hole.
        hole: usize,
        /// What is wrong with it.
        problem: crate::specimen::NotchProblem,
    },
    /// Holes along different axes cross.
    #[error("hole {hole} has another axis than hole 0; give all holes the same axis")]
    MixedHoleAxes {
        /// Index of the first hole that differs.
        hole: usize,
    },
    /// Holes along the width of a dumb-bell: the section changes along the extrusion.
    #[error("hole {hole} runs along the width of a dumb-bell; only holes along the thickness can be meshed there")]
    UnsupportedHoleAxis {
        /// Index of the first such hole.
        hole: usize,
    },
    /// The block is not that of the standard outline.
    #[error("the dumb-bell needs {name} {relation} {limit_mm} mm, not {value_mm} mm")]
    OutlineMismatch {
        /// Name of the dimension.
        name: &'static str,
        /// Its value, mm.
        value_mm: f64,
        /// How it must compare with the limit.
        relation: &'static str,
        /// The limit, mm.
        limit_mm: f64,
    },
    /// Two walls nearly touch, touch or overlap (negative length).
    #[error(
        "the ligament between {from} and {to} is {length_mm} mm; at least {limit_mm} mm can be meshed: move or shrink the hole"
    )]
    LigamentTooThin {
        /// One end.
        from: LigamentEnd,
        /// The other end.
        to: LigamentEnd,
        /// Its length, mm; negative where walls overlap.
        length_mm: f64,
        /// Smallest length that is meshed, mm.
        limit_mm: f64,
    },
    /// A wedge that is not meshed: in a uniaxial test, with holes along the width, or without thickness at an end.
    #[error(
        "wedge_mm is {value_mm} mm; only a double-lap shear block with holes along its thickness may be a wedge, of less than twice its thickness ({thickness_mm} mm): set it to 0, or change the test or the holes"
    )]
    UnsupportedWedge {
        /// The wedge, mm.
        value_mm: f64,
        /// Thickness in the middle, mm.
        thickness_mm: f64,
    },
    /// More elements than the options allow.
    #[error("about {elements} elements are needed, the limit is {limit}; increase the element size or the limit")]
    TooManyElements {
        /// Estimated or counted number of elements.
        elements: usize,
        /// [`super::MeshOptions::max_elements`].
        limit: usize,
    },
    /// The best mesh found has a badly shaped element.
    #[error(
        "element {element} has a scaled Jacobian of {scaled_jacobian}, the limit is {limit}; use smaller elements or wider ligaments"
    )]
    PoorElement {
        /// Element (or section cell) index.
        element: usize,
        /// Its scaled Jacobian, 1 at best, negative if inverted.
        scaled_jacobian: f64,
        /// [`super::MeshOptions::min_scaled_jacobian`].
        limit: f64,
    },
    /// The Delaunay refinement ran out of vertices.
    #[error("the refinement of the section needs more than {limit} additional vertices; increase the element size")]
    RefinementIncomplete {
        /// Vertices allowed.
        limit: usize,
    },
    /// The boundary of the section could not be triangulated.
    #[error("the section's boundary point ({x_mm}, {y_mm}) mm could not be inserted in the triangulation")]
    Triangulation {
        /// First coordinate, mm.
        x_mm: f64,
        /// Second coordinate, mm.
        y_mm: f64,
    },
    /// The section needs triangles, without which the library was built.
    #[error(
        "quadrilaterals do not suit this section, and lambdak was built without triangles: turn on its feature `triangles`"
    )]
    NoTriangles,
    /// The geometry Jacobian of an element is not positive.
    #[error("element {element} has a geometry Jacobian of {jacobian:e} mm³; it must be positive")]
    InvertedElement {
        /// Element index.
        element: usize,
        /// Smallest geometry Jacobian found in it, mm³.
        jacobian: f64,
    },
    /// The mesh's volume differs from the specimen's.
    #[error(
        "the mesh has a volume of {volume_mm3} mm³, the specimen {expected_mm3} mm³ (tolerance {tolerance_mm3} mm³)"
    )]
    VolumeMismatch {
        /// Volume by quadrature, mm³.
        volume_mm3: f64,
        /// Closed form, mm³ (the meshed part only).
        expected_mm3: f64,
        /// Tolerance, mm³.
        tolerance_mm3: f64,
    },
    /// The mesh is said to be that of another wedge, or of none.
    #[error(
        "the mesh's gap changes by {found} of its middle per mm along x, the specimen's by {expected}; give the mesh the specimen's taper"
    )]
    WrongTaper {
        /// The mesh's slope, mm⁻¹.
        found: f64,
        /// The specimen's, mm⁻¹.
        expected: f64,
    },
    /// A face belongs to one element only but does not lie on the specimen's surface: a hole in the mesh.
    #[error("a face of element {element} around ({}, {}, {}) mm is open but not on the specimen's surface", center_mm[0], center_mm[1], center_mm[2])]
    OpenFace {
        /// Element index.
        element: usize,
        /// Centre of the face, mm.
        center_mm: [f64; 3],
    },
    /// A face is shared by more than two elements, or by two that disagree on its middle nodes.
    #[error("a face of element {element} does not match its neighbour")]
    FaceMismatch {
        /// Element index.
        element: usize,
    },
    /// A tagged node set is not the set of nodes on its face.
    #[error("the node set `{set}` holds {found} nodes, but {expected} lie on its face")]
    NodeSetMismatch {
        /// Name of the set.
        set: &'static str,
        /// Nodes in the set.
        found: usize,
        /// Nodes on the face.
        expected: usize,
    },
    /// Node indices out of range, or coordinates that are not finite.
    #[error("the mesh is malformed: {count} node references or coordinates are invalid")]
    Malformed {
        /// How many.
        count: usize,
    },
}
