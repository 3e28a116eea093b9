//! A solid as a STEP file: ISO 10303-21 with the schema of AP214 (`AUTOMOTIVE_DESIGN`), which every CAD program reads.

use super::solid::{EdgeCurve, Face, OrientedEdge, Solid, SpaceConic, Surface};
use crate::provenance::VERSION;

/// Points nearer than this are one point, mm.
const ACCURACY_MM: &str = "1.E-06";
/// Entities that every file begins with; the first is number 1.
const UNITS: [&str; 6] = [
    "APPLICATION_CONTEXT('core data for automotive mechanical design processes')",
    "(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT(.MILLI.,.METRE.))",
    "(NAMED_UNIT(*)PLANE_ANGLE_UNIT()SI_UNIT($,.RADIAN.))",
    "(NAMED_UNIT(*)SI_UNIT($,.STERADIAN.)SOLID_ANGLE_UNIT())",
    "APPLICATION_PROTOCOL_DEFINITION('international standard','automotive_design',2000,#1)",
    "PRODUCT_CONTEXT('',#1,'mechanical')",
];

/// The file's entities, numbered from 1.
#[derive(Default)]
struct Entities {
    text: String,
    count: usize,
}

impl Entities {
    /// Adds an entity; gives its number.
    fn add(&mut self, entity: &str) -> usize {
        self.count += 1;
        self.text += &format!("#{}={entity};\n", self.count);
        self.count
    }

    fn point(&mut self, p: [f64; 3]) -> usize {
        self.add(&format!("CARTESIAN_POINT('',{})", triple(p)))
    }

    fn direction(&mut self, d: [f64; 3]) -> usize {
        self.add(&format!("DIRECTION('',{})", triple(d)))
    }

    fn placement(&mut self, origin: [f64; 3], axis: [f64; 3], along: [f64; 3]) -> usize {
        let (origin, axis, along) = (self.point(origin), self.direction(axis), self.direction(along));
        self.add(&format!("AXIS2_PLACEMENT_3D('',#{origin},#{axis},#{along})"))
    }

    fn vector(&mut self, direction: [f64; 3], length: f64) -> usize {
        let direction = self.direction(direction);
        self.add(&format!("VECTOR('',#{direction},{})", real(length)))
    }

    fn conic(&mut self, conic: &SpaceConic) -> usize {
        let placement = self.placement(conic.center_mm, conic.axis, conic.along);
        let [a, b] = conic.half_mm;
        if conic.is_circle() {
            self.add(&format!("CIRCLE('',#{placement},{})", real(a)))
        } else {
            self.add(&format!("ELLIPSE('',#{placement},{},{})", real(a), real(b)))
        }
    }
}

/// The file of a solid.
pub(super) fn step_file(name: &str, solid: &Solid) -> String {
    let mut entities = Entities::default();
    for entity in UNITS {
        entities.add(entity);
    }
    let name = text(name);
    let product = entities.add(&format!("PRODUCT({name},{name},'',(#6))"));
    let formation = entities.add(&format!("PRODUCT_DEFINITION_FORMATION('','',#{product})"));
    let stage = entities.add("PRODUCT_DEFINITION_CONTEXT('part definition',#1,'design')");
    let definition = entities.add(&format!("PRODUCT_DEFINITION('design','',#{formation},#{stage})"));
    let shape = entities.add(&format!("PRODUCT_DEFINITION_SHAPE('','',#{definition})"));
    entities.add(&format!("PRODUCT_RELATED_PRODUCT_CATEGORY('part',$,(#{product}))"));
    let accuracy = entities
        .add(&format!("UNCERTAINTY_MEASURE_WITH_UNIT(LENGTH_MEASURE({ACCURACY_MM}),#2,'distance_accuracy_value','')"));
    let context = entities.add(&format!(
        "(GEOMETRIC_REPRESENTATION_CONTEXT(3)GLOBAL_UNCERTAINTY_ASSIGNED_CONTEXT((#{accuracy}))\
         GLOBAL_UNIT_ASSIGNED_CONTEXT((#2,#3,#4))REPRESENTATION_CONTEXT('',''))"
    ));
    let origin = entities.placement([0.0; 3], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]);
    let brep = solid_entity(&mut entities, &name, solid);
    let representation = format!("ADVANCED_BREP_SHAPE_REPRESENTATION({name},(#{origin},#{brep}),#{context})");
    let representation = entities.add(&representation);
    entities.add(&format!("SHAPE_DEFINITION_REPRESENTATION(#{shape},#{representation})"));
    format!(
        "ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION((''),'2;1');\n\
         FILE_NAME({name},'',(''),(''),'lambdak {VERSION}','lambdak','');\n\
         FILE_SCHEMA(('AUTOMOTIVE_DESIGN {{ 1 0 10303 214 1 1 1 1 }}'));\nENDSEC;\nDATA;\n{}ENDSEC;\n\
         END-ISO-10303-21;\n",
        entities.text
    )
}

/// Adds the solid with all that it is made of.
fn solid_entity(entities: &mut Entities, name: &str, solid: &Solid) -> usize {
    let vertices: Vec<usize> = solid
        .vertices
        .iter()
        .map(|&p| {
            let point = entities.point(p);
            entities.add(&format!("VERTEX_POINT('',#{point})"))
        })
        .collect();
    let mut edges = Vec::with_capacity(solid.edges.len());
    for edge in &solid.edges {
        let [from, to] = edge.ends.map(|end| solid.vertices[end]);
        let (curve, is_same) = match edge.curve {
            EdgeCurve::Line => {
                let along = [0, 1, 2].map(|c| to[c] - from[c]);
                let length = along.iter().map(|c| c * c).sum::<f64>().sqrt();
                let (point, vector) = (entities.point(from), entities.vector(along.map(|c| c / length), length));
                (entities.add(&format!("LINE('',#{point},#{vector})")), true)
            }
            EdgeCurve::Conic { conic, is_counterclockwise } => (entities.conic(&conic), is_counterclockwise),
        };
        let [from, to] = edge.ends.map(|end| vertices[end]);
        edges.push(entities.add(&format!("EDGE_CURVE('',#{from},#{to},#{curve},{})", logical(is_same))));
    }
    let faces: Vec<usize> = solid.faces.iter().map(|face| face_entity(entities, solid, &edges, face)).collect();
    let shell = entities.add(&format!("CLOSED_SHELL('',({}))", references(&faces)));
    entities.add(&format!("MANIFOLD_SOLID_BREP({name},#{shell})"))
}

/// Adds a face.
fn face_entity(entities: &mut Entities, solid: &Solid, edges: &[usize], face: &Face) -> usize {
    let mut bounds = Vec::with_capacity(face.bounds.len());
    for (index, walk) in face.bounds.iter().enumerate() {
        let passed = |&(edge, is_forward): &OrientedEdge| {
            entities.add(&format!("ORIENTED_EDGE('',*,*,#{},{})", edges[edge], logical(is_forward)))
        };
        let passed: Vec<usize> = walk.iter().map(passed).collect();
        let ring = entities.add(&format!("EDGE_LOOP('',({}))", references(&passed)));
        let kind = if index == 0 { "FACE_OUTER_BOUND" } else { "FACE_BOUND" };
        bounds.push(entities.add(&format!("{kind}('',#{ring},.T.)")));
    }
    let (surface, is_same) = match face.surface {
        Surface::Plane { vertex, normal, along } => {
            let placement = entities.placement(solid.vertices[vertex], normal, along);
            (entities.add(&format!("PLANE('',#{placement})")), true)
        }
        Surface::Extruded { conic, is_convex } if conic.is_circle() => {
            let placement = entities.placement(conic.center_mm, solid.axis, conic.along);
            let radius = real(conic.half_mm[0]);
            (entities.add(&format!("CYLINDRICAL_SURFACE('',#{placement},{radius})")), is_convex)
        }
        // Along the ellipse times along the axis points out of it.
        Surface::Extruded { conic, is_convex } => {
            let (curve, vector) = (entities.conic(&conic), entities.vector(solid.axis, 1.0));
            (entities.add(&format!("SURFACE_OF_LINEAR_EXTRUSION('',#{curve},#{vector})")), is_convex)
        }
    };
    entities.add(&format!("ADVANCED_FACE('',({}),#{surface},{})", references(&bounds), logical(is_same)))
}

fn references(numbers: &[usize]) -> String {
    numbers.iter().map(|n| format!("#{n}")).collect::<Vec<_>>().join(",")
}

fn logical(value: bool) -> &'static str {
    if value { ".T." } else { ".F." }
}

fn triple(p: [f64; 3]) -> String {
    format!("({})", p.map(real).join(","))
}

/// A number as STEP writes it: always with a point, all digits that tell it from its neighbours.
fn real(value: f64) -> String {
    // Adding zero turns −0 into 0.
    let text = format!("{:?}", value + 0.0);
    match text.split_once('e') {
        None => text,
        Some((mantissa, exponent)) => {
            let point = if mantissa.contains('.') { "" } else { "." };
            format!("{mantissa}{point}E{exponent}")
        }
    }
}

/// A text in quotation marks; what is not ASCII as UCS.
fn text(value: &str) -> String {
    let mut quoted = String::from("'");
    for c in value.chars() {
        match c {
            '\'' => quoted += "''",
            '\\' => quoted += "\\\\",
            ' '..='~' => quoted.push(c),
            c if u32::from(c) < 0x1_0000 => quoted += &format!("\\X2\\{:04X}\\X0\\", u32::from(c)),
            c => quoted += &format!("\\X4\\{:08X}\\X0\\", u32::from(c)),
        }
    }
    quoted + "'"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_points_and_texts_are_ascii() {
        let numbers = [1.0, -0.0, 1e-7, -2.5e300, 0.1].map(real);
        assert_eq!(numbers, ["1.0", "0.0", "1.E-7", "-2.5E300", "0.1"]);
        assert_eq!(text("d'é\\ 𝜇"), "'d''\\X2\\00E9\\X0\\\\\\ \\X4\\0001D707\\X0\\'");
    }
}
