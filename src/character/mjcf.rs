//! Loader for the supported subset of MJCF. Anything outside the subset is an error, never silently dropped.

use nalgebra::{Matrix3, Vector3};

use super::mjcf_attributes::Element;
use super::{BODIES, Body, CONTACTS, CharacterModel, ContactPoint, DOF, JOINTS, Joint, MAX_CHAIN};
use crate::units::{RAD_PER_DEG, STANDARD_GRAVITY};

/// The built-in standing character.
pub const STANDING_MJCF: &str = include_str!("../../configs/characters/standing.xml");

/// Names of the contact spheres in storage order.
const CONTACT_NAMES: [&str; CONTACTS] = ["cl0", "cl1", "cl2", "cl3", "cr0", "cr1", "cr2", "cr3"];

/// Why a model file was refused.
#[derive(Debug, thiserror::Error)]
pub enum ModelError {
    /// The text is not XML.
    #[error(
        "{source_name}: not XML: {source}\n\nhint: the model file is MJCF, see configs/characters/standing.xml"
    )]
    Xml {
        /// Name of the file.
        source_name: String,
        /// What the parser said.
        source: roxmltree::Error,
    },
    /// An element outside the subset.
    #[error(
        "{place}: element <{element}> in <{parent}> is not supported\n\nhint: supported there: {supported}"
    )]
    UnsupportedElement {
        /// `file:line`.
        place: String,
        /// Name of the element.
        element: String,
        /// Name of the enclosing element.
        parent: String,
        /// What is supported there.
        supported: String,
    },
    /// An attribute outside the subset.
    #[error(
        "{place}: attribute `{attribute}` of <{element}> is not supported\n\nhint: supported: {supported}"
    )]
    UnsupportedAttribute {
        /// `file:line`.
        place: String,
        /// Name of the element.
        element: String,
        /// Name of the attribute.
        attribute: String,
        /// What is supported there.
        supported: String,
    },
    /// A value that cannot be used.
    #[error(
        "{place}: `{attribute}` of <{element}> is `{got}`, expected {expected}\n\n\
         hint: configs/characters/standing.xml shows how it is written"
    )]
    BadValue {
        /// `file:line`.
        place: String,
        /// Name of the element.
        element: String,
        /// Name of the attribute.
        attribute: String,
        /// The text found.
        got: String,
        /// What would be right.
        expected: String,
    },
    /// The file is well formed but is not a character otolith can balance.
    #[error(
        "{source_name}: {what}\n\nhint: a character has 19 bodies, a free root and 35 hinges, feet `foot_l` and \
             `foot_r` with the contact spheres cl0..cl3 and cr0..cr3, a `head` with the site `vestibule`, and a `thorax`"
    )]
    Shape {
        /// Name of the file.
        source_name: String,
        /// What is missing or too much.
        what: String,
    },
}

/// Everything collected while walking the file.
struct Loader<'a> {
    source: &'a str,
    radians: bool,
    friction: f64,
    gravity: Vector3<f64>,
    bodies: Vec<Body>,
    joints: Vec<Joint>,
    contacts: [Option<ContactPoint>; CONTACTS],
    vestibule: Option<(usize, Vector3<f64>)>,
    notes: Vec<String>,
}

pub(super) fn load(text: &str, source: &str) -> Result<CharacterModel, ModelError> {
    let document = roxmltree::Document::parse(text)
        .map_err(|error| ModelError::Xml { source_name: source.to_owned(), source: error })?;
    let root = Element { node: document.root_element(), source };
    if root.name() != "mujoco" {
        return Err(root.unsupported("the file", "mujoco"));
    }
    root.allow(&["model"], &[])?;
    let mut loader = Loader {
        source,
        radians: false,
        friction: 1.0,
        gravity: Vector3::new(0.0, 0.0, -STANDARD_GRAVITY),
        bodies: Vec::new(),
        joints: Vec::new(),
        contacts: [None; CONTACTS],
        vestibule: None,
        notes: Vec::new(),
    };
    // Units and defaults may stand after the bodies they apply to.
    for section in root.children() {
        match section.name() {
            "compiler" => loader.compiler(section)?,
            "option" => loader.option(section)?,
            "default" => loader.default(section)?,
            "worldbody" | "actuator" | "sensor" => {}
            _ => {
                return Err(
                    section.unsupported("mujoco", "compiler, option, default, worldbody, actuator, sensor")
                );
            }
        }
    }
    for section in root.children() {
        match section.name() {
            "worldbody" => loader.world(section)?,
            "actuator" => loader.actuator(section)?,
            "sensor" => loader.sensor(section)?,
            _ => {}
        }
    }
    loader.finish()
}

impl Loader<'_> {
    fn compiler(&mut self, element: Element) -> Result<(), ModelError> {
        element.allow(&["angle"], &["balanceinertia"])?;
        self.radians = match element.text("angle") {
            Some("radian") => true,
            None | Some("degree") => false,
            Some(_) => return Err(element.bad_value("angle", "radian or degree")),
        };
        Ok(())
    }

    fn option(&mut self, element: Element) -> Result<(), ModelError> {
        let ignored = ["timestep", "integrator", "cone", "impratio", "iterations", "tolerance"];
        element.allow(&["gravity"], &ignored)?;
        if let Some(gravity) = element.vector("gravity")? {
            self.gravity = gravity;
        }
        let present: Vec<&str> = ignored.into_iter().filter(|name| element.text(name).is_some()).collect();
        if !present.is_empty() {
            self.notes.push(format!(
                "{}: settings of another engine, ignored: {}",
                element.place(),
                present.join(", ")
            ));
        }
        Ok(())
    }

    fn default(&mut self, element: Element) -> Result<(), ModelError> {
        element.allow(&[], &[])?;
        for child in element.children() {
            if child.name() != "geom" {
                return Err(child.unsupported("default", "geom"));
            }
            child.allow(&["friction"], &["condim", "solref", "solimp"])?;
            if let Some(friction) = child.numbers("friction", 3)? {
                self.friction = friction[0];
            }
        }
        Ok(())
    }

    fn world(&mut self, world: Element) -> Result<(), ModelError> {
        for child in world.children() {
            match child.name() {
                "body" if is_platform(child) => self.platform(child)?,
                "body" if self.bodies.is_empty() => self.body(child, None)?,
                "body" => return Err(self.shape("more than one character in the worldbody".to_owned())),
                "geom" => self.geom(child, None)?,
                _ => return Err(child.unsupported("worldbody", "body, geom")),
            }
        }
        Ok(())
    }

    /// The moving ground: a body with the single hinge `platform`. It becomes a ground surface, not a degree of freedom.
    fn platform(&mut self, element: Element) -> Result<(), ModelError> {
        element.allow(&["name", "pos", "quat"], &[])?;
        for child in element.children() {
            match child.name() {
                "inertial" | "joint" => {}
                "geom" => self.geom(child, None)?,
                _ => return Err(child.unsupported("body (platform)", "inertial, joint, geom")),
            }
        }
        Ok(())
    }

    fn body(&mut self, element: Element, parent: Option<usize>) -> Result<(), ModelError> {
        element.allow(&["name", "pos", "quat"], &[])?;
        let index = self.bodies.len();
        let name = element.text("name").unwrap_or_default().to_owned();
        let inertial = element
            .children()
            .find(|child| child.name() == "inertial")
            .ok_or_else(|| self.shape(format!("body `{name}` has no <inertial>")))?;
        let (mass, com, inertia) = read_inertial(inertial)?;
        self.bodies.push(Body {
            name,
            parent: parent.unwrap_or(index),
            origin_in_parent: element.vector("pos")?.unwrap_or_default(),
            rot_parent_body: element.rotation()?,
            mass,
            com,
            inertia,
            first_dof: if parent.is_none() { 0 } else { 6 + self.joints.len() },
            dofs: 0,
        });
        for child in element.children() {
            match child.name() {
                "inertial" => {}
                "freejoint" if parent.is_none() => self.bodies[index].dofs = 6,
                "joint" if parent.is_some() => self.joint(child, index)?,
                "geom" => self.geom(child, Some(index))?,
                "site" => self.site(child, index)?,
                "body" => self.body(child, Some(index))?,
                _ => {
                    return Err(child.unsupported(
                        "body",
                        "inertial, freejoint (root), joint (others), geom, site, body",
                    ));
                }
            }
        }
        if self.bodies[index].dofs == 0 && parent.is_none() {
            return Err(self.shape("the root body has no <freejoint>".to_owned()));
        }
        Ok(())
    }

    fn joint(&mut self, element: Element, body: usize) -> Result<(), ModelError> {
        element.allow(&["name", "type", "axis", "pos", "armature", "range"], &[])?;
        if element.text("type").is_some_and(|kind| kind != "hinge") {
            return Err(element.bad_value("type", "hinge"));
        }
        let axis = element.vector("axis")?.unwrap_or_else(Vector3::z);
        let axis =
            axis.try_normalize(1e-9).ok_or_else(|| element.bad_value("axis", "a vector that is not zero"))?;
        let unit = if self.radians { 1.0 } else { RAD_PER_DEG };
        let range = element.numbers("range", 2)?.map(|r| (r[0] * unit, r[1] * unit));
        if range.is_some_and(|(low, high)| low >= high) {
            return Err(element.bad_value("range", "a lower limit below the upper one"));
        }
        let armature = element.scalar("armature")?.unwrap_or(0.0);
        if armature < 0.0 {
            return Err(element.bad_value("armature", "at least 0"));
        }
        let name = element.text("name").unwrap_or_default().to_owned();
        let anchor = element.vector("pos")?.unwrap_or_default();
        self.joints.push(Joint { name, body, axis, anchor, armature, range });
        self.bodies[body].dofs += 1;
        Ok(())
    }

    fn geom(&mut self, element: Element, body: Option<usize>) -> Result<(), ModelError> {
        let shapes = ["sphere", "capsule", "box", "ellipsoid", "plane"];
        element.allow(
            &["name", "type", "size", "pos", "mass", "friction"],
            &["fromto", "quat", "contype", "conaffinity", "condim", "solref", "solimp", "rgba"],
        )?;
        let kind = element.text("type").unwrap_or("sphere");
        if !shapes.contains(&kind) {
            return Err(element.bad_value("type", &shapes.join(", ")));
        }
        let contact = element.text("name").and_then(|name| CONTACT_NAMES.iter().position(|n| *n == name));
        if let (Some(point), Some(body)) = (contact, body) {
            if kind != "sphere" {
                return Err(element.bad_value("type", "sphere for a contact point"));
            }
            let radius = element.scalar("size")?.ok_or_else(|| element.bad_value("size", "a radius"))?;
            let position = element.vector("pos")?.unwrap_or_default();
            self.contacts[point] = Some(ContactPoint { body, position, radius });
            if let Some(friction) = element.numbers("friction", 3)? {
                self.friction = friction[0];
            }
        }
        Ok(())
    }

    fn site(&mut self, element: Element, body: usize) -> Result<(), ModelError> {
        element.allow(&["name", "pos"], &["size", "type", "rgba"])?;
        if element.text("name") == Some("vestibule") {
            self.vestibule = Some((body, element.vector("pos")?.unwrap_or_default()));
        }
        Ok(())
    }

    fn actuator(&mut self, section: Element) -> Result<(), ModelError> {
        for child in section.children() {
            if child.name() != "motor" {
                return Err(child.unsupported("actuator", "motor"));
            }
            child.allow(&["name", "joint"], &[])?;
            let joint = child.text("joint").unwrap_or_default();
            if !self.joints.iter().any(|j| j.name == joint) {
                return Err(child.bad_value("joint", "the name of a hinge"));
            }
        }
        Ok(())
    }

    fn sensor(&self, section: Element) -> Result<(), ModelError> {
        for child in section.children() {
            if !["gyro", "accelerometer"].contains(&child.name()) {
                return Err(child.unsupported("sensor", "gyro, accelerometer"));
            }
            child.allow(&["name", "site"], &[])?;
        }
        Ok(())
    }

    fn shape(&self, what: String) -> ModelError {
        ModelError::Shape { source_name: self.source.to_owned(), what }
    }

    fn named(&self, name: &str) -> Result<usize, ModelError> {
        let found = self.bodies.iter().position(|body| body.name == name);
        found.ok_or_else(|| self.shape(format!("there is no body `{name}`")))
    }

    fn finish(self) -> Result<CharacterModel, ModelError> {
        if self.bodies.len() != BODIES || self.joints.len() != JOINTS {
            let what = format!(
                "{} bodies and {} hinges, expected {BODIES} and {JOINTS}",
                self.bodies.len(),
                self.joints.len()
            );
            return Err(self.shape(what));
        }
        let mut contacts = Vec::with_capacity(CONTACTS);
        for (name, contact) in CONTACT_NAMES.iter().zip(&self.contacts) {
            contacts.push(contact.ok_or_else(|| self.shape(format!("there is no contact sphere `{name}`")))?);
        }
        let contacts: [ContactPoint; CONTACTS] = std::array::from_fn(|i| contacts[i]);
        let (head, vestibule) =
            self.vestibule.ok_or_else(|| self.shape("there is no site `vestibule`".to_owned()))?;
        let feet = [self.named("foot_l")?, self.named("foot_r")?];
        if contacts.iter().enumerate().any(|(i, contact)| contact.body != feet[i / (CONTACTS / 2)]) {
            return Err(self.shape("cl0..cl3 belong on foot_l and cr0..cr3 on foot_r".to_owned()));
        }
        let thorax = self.named("thorax")?;
        let tree = DofTree::of(&self.bodies);
        if tree.chain_len.iter().any(|len| *len > MAX_CHAIN) {
            return Err(self.shape(format!("a chain of more than {MAX_CHAIN} degrees of freedom")));
        }
        let model = CharacterModel {
            bodies: self.bodies,
            joints: self.joints,
            contacts,
            feet,
            head,
            vestibule,
            thorax,
            gravity: self.gravity,
            friction: self.friction,
            dof_parent: tree.parent,
            chain: tree.chain,
            chain_len: tree.chain_len,
            dof_body: tree.body,
            notes: self.notes,
        };
        for foot in feet {
            let chain = model.body_chain(foot).len();
            if chain != super::FOOT_CHAIN {
                let what =
                    format!("`{}` hangs on {chain} degrees of freedom, expected 12", model.bodies[foot].name);
                return Err(ModelError::Shape { source_name: self.source.to_owned(), what });
            }
        }
        Ok(model)
    }
}

fn is_platform(element: Element) -> bool {
    let mut joints = element.children().filter(|child| child.name() == "joint");
    joints.next().is_some_and(|joint| joint.text("name") == Some("platform")) && joints.next().is_none()
}

fn read_inertial(element: Element) -> Result<(f64, Vector3<f64>, Matrix3<f64>), ModelError> {
    element.allow(&["pos", "mass", "diaginertia", "quat"], &[])?;
    let mass = element.scalar("mass")?.filter(|mass| *mass > 0.0);
    let mass = mass.ok_or_else(|| element.bad_value("mass", "more than 0 kg"))?;
    let diagonal = element.vector("diaginertia")?.filter(|d| d.min() > 0.0);
    let diagonal =
        diagonal.ok_or_else(|| element.bad_value("diaginertia", "three moments of more than 0 kg m2"))?;
    let rotation = element.rotation()?;
    let inertia = rotation * Matrix3::from_diagonal(&diagonal) * rotation.transpose();
    Ok((mass, element.vector("pos")?.unwrap_or_default(), inertia))
}

/// The kinematic tree seen degree of freedom by degree of freedom.
struct DofTree {
    parent: [usize; DOF],
    chain: [[usize; MAX_CHAIN]; DOF],
    chain_len: [usize; DOF],
    body: [usize; DOF],
}

impl DofTree {
    fn of(bodies: &[Body]) -> Self {
        let mut tree =
            Self { parent: [0; DOF], chain: [[0; MAX_CHAIN]; DOF], chain_len: [0; DOF], body: [0; DOF] };
        let mut last_dof_of_body = [0usize; BODIES];
        for (index, body) in bodies.iter().enumerate() {
            let mut previous = if index == 0 { 0 } else { last_dof_of_body[body.parent] };
            for dof in body.first_dof..body.first_dof + body.dofs {
                tree.parent[dof] = previous;
                tree.body[dof] = index;
                if dof > 0 {
                    tree.chain_len[dof] = tree.chain_len[previous];
                    tree.chain[dof] = tree.chain[previous];
                }
                if tree.chain_len[dof] < MAX_CHAIN {
                    tree.chain[dof][tree.chain_len[dof]] = dof;
                }
                tree.chain_len[dof] += 1;
                previous = dof;
            }
            last_dof_of_body[index] = previous;
        }
        tree
    }
}
