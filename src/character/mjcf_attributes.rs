//! Reading attributes of MJCF elements, with errors that name file, line, element and attribute.

use nalgebra::{Matrix3, Vector3};
use roxmltree::Node;

use super::attitude_wxyz;
use super::mjcf::ModelError;

/// One element of the model file together with the file's name.
#[derive(Clone, Copy)]
pub(super) struct Element<'a, 'i> {
    pub(super) node: Node<'a, 'i>,
    pub(super) source: &'a str,
}

impl<'a, 'i> Element<'a, 'i> {
    pub(super) fn name(&self) -> &'a str {
        self.node.tag_name().name()
    }

    /// `file:line`.
    pub(super) fn place(&self) -> String {
        let line = self.node.document().text_pos_at(self.node.range().start).row;
        format!("{}:{line}", self.source)
    }

    pub(super) fn children(&self) -> impl Iterator<Item = Element<'a, 'i>> + use<'a, 'i> {
        let source = self.source;
        self.node.children().filter(|node| node.is_element()).map(move |node| Element { node, source })
    }

    /// Refuses every attribute that is in none of the two lists; the second list is accepted and ignored.
    pub(super) fn allow(&self, read: &[&str], ignored: &[&str]) -> Result<(), ModelError> {
        for attribute in self.node.attributes() {
            if !read.contains(&attribute.name()) && !ignored.contains(&attribute.name()) {
                return Err(ModelError::UnsupportedAttribute {
                    place: self.place(),
                    element: self.name().to_owned(),
                    attribute: attribute.name().to_owned(),
                    supported: [read, ignored].concat().join(", "),
                });
            }
        }
        Ok(())
    }

    pub(super) fn unsupported(&self, parent: &str, supported: &str) -> ModelError {
        ModelError::UnsupportedElement {
            place: self.place(),
            element: self.name().to_owned(),
            parent: parent.to_owned(),
            supported: supported.to_owned(),
        }
    }

    pub(super) fn text(&self, attribute: &str) -> Option<&'a str> {
        self.node.attribute(attribute)
    }

    /// `count` numbers; `None` when the attribute is absent.
    pub(super) fn numbers(&self, attribute: &str, count: usize) -> Result<Option<Vec<f64>>, ModelError> {
        let Some(text) = self.node.attribute(attribute) else { return Ok(None) };
        let numbers: Option<Vec<f64>> =
            text.split_whitespace().map(|word| word.parse().ok().filter(|x: &f64| x.is_finite())).collect();
        match numbers {
            Some(numbers) if numbers.len() == count => Ok(Some(numbers)),
            _ => Err(self.bad_value(attribute, &format!("{count} finite numbers"))),
        }
    }

    pub(super) fn bad_value(&self, attribute: &str, expected: &str) -> ModelError {
        ModelError::BadValue {
            place: self.place(),
            element: self.name().to_owned(),
            attribute: attribute.to_owned(),
            got: self.node.attribute(attribute).unwrap_or("nothing").to_owned(),
            expected: expected.to_owned(),
        }
    }

    pub(super) fn scalar(&self, attribute: &str) -> Result<Option<f64>, ModelError> {
        Ok(self.numbers(attribute, 1)?.map(|numbers| numbers[0]))
    }

    pub(super) fn vector(&self, attribute: &str) -> Result<Option<Vector3<f64>>, ModelError> {
        Ok(self.numbers(attribute, 3)?.map(|n| Vector3::new(n[0], n[1], n[2])))
    }

    /// Rotation of the `quat` attribute (w x y z); identity when absent.
    pub(super) fn rotation(&self) -> Result<Matrix3<f64>, ModelError> {
        match self.numbers("quat", 4)? {
            None => Ok(Matrix3::identity()),
            Some(q) if q.iter().map(|x| x * x).sum::<f64>() < 1e-12 => {
                Err(self.bad_value("quat", "a quaternion w x y z that is not zero"))
            }
            Some(q) => Ok(attitude_wxyz(q[0], q[1], q[2], q[3]).to_rotation_matrix().into_inner()),
        }
    }
}
