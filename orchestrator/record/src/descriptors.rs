//! Descriptors of messages as recordings carry them: those that a reader of one type needs, and no comments.

use prost::Message as _;
use prost_types::field_descriptor_proto::Type;
use prost_types::{DescriptorProto, FileDescriptorProto, FileDescriptorSet};
use std::collections::BTreeSet;

/// Of an encoded set of descriptors, the part that the message type `root`, such as `cosim.v1.Deliveries`, is made of: it, all types
/// that it refers to, and their files.
///
/// # Panics
///
/// If the set is none, which was compiled into the program.
pub(crate) fn descriptors_of(set: &[u8], root: &str) -> Vec<u8> {
    let mut set =
        FileDescriptorSet::decode(set).expect("the descriptors were compiled into the program");
    let mut wanted = BTreeSet::new();
    reach(&set, &format!(".{root}"), &mut wanted);
    for file in &mut set.file {
        file.source_code_info = None;
        file.service.clear();
        let package = package(file);
        let is_wanted = |name: Option<&String>| {
            name.is_some_and(|name| wanted.contains(&format!("{package}.{name}")))
        };
        file.message_type.retain(|message| is_wanted(message.name.as_ref()));
        file.enum_type.retain(|of| is_wanted(of.name.as_ref()));
    }
    let is_empty =
        |file: &FileDescriptorProto| file.message_type.is_empty() && file.enum_type.is_empty();
    let left_out: BTreeSet<String> =
        set.file.iter().filter(|file| is_empty(file)).map(|file| file.name().to_owned()).collect();
    set.file.retain(|file| !left_out.contains(file.name()));
    for file in &mut set.file {
        file.dependency.retain(|name| !left_out.contains(name));
        file.public_dependency.clear();
        file.weak_dependency.clear();
    }
    set.encode_to_vec()
}

/// The package of a file, as full names begin.
fn package(file: &FileDescriptorProto) -> String {
    format!(".{}", file.package())
}

/// Adds the types at top level that a type, `.package.Name` or one within such, refers to.
fn reach(set: &FileDescriptorSet, name: &str, wanted: &mut BTreeSet<String>) {
    for file in &set.file {
        let Some(rest) = name.strip_prefix(&format!("{}.", package(file))) else { continue };
        let top = rest.split('.').next().unwrap_or_default();
        let full = format!("{}.{top}", package(file));
        if file.enum_type.iter().any(|of| of.name() == top) {
            wanted.insert(full);
        } else if let Some(message) = file.message_type.iter().find(|it| it.name() == top)
            && wanted.insert(full)
        {
            for name in references(message) {
                reach(set, &name, wanted);
            }
        }
    }
}

/// Full names of the types of all fields of a message and of those within it.
fn references(message: &DescriptorProto) -> Vec<String> {
    let fields = message
        .field
        .iter()
        .filter(|field| matches!(field.r#type(), Type::Message | Type::Enum | Type::Group));
    let own = fields.map(|field| field.type_name().to_owned());
    own.chain(message.nested_type.iter().flat_map(references)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(root: &str) -> FileDescriptorSet {
        let set = descriptors_of(proto_messages::FILE_DESCRIPTOR_SET, root);
        FileDescriptorSet::decode(&set[..]).unwrap()
    }

    fn types(set: &FileDescriptorSet) -> Vec<&str> {
        set.file.iter().flat_map(|file| file.message_type.iter().map(|it| it.name())).collect()
    }

    #[test]
    fn a_type_comes_with_what_it_is_made_of_and_nothing_else() {
        let barrier = of("cosim.v1.RobotSimServiceBarrierResponse");
        assert_eq!(types(&barrier), ["RobotSimServiceBarrierResponse"]);
        assert!(barrier.file.iter().all(|file| file.dependency.is_empty()));

        let step = of("cosim.v1.NetSimServiceStepResponse");
        let names = types(&step);
        for name in ["Deliveries", "Transmissions", "Payloads", "Packets", "PacketKind", "Frames"] {
            assert!(names.contains(&name), "{name} {names:?}");
        }
        assert!(!names.contains(&"NetSimServiceConfigureRequest"));
        let enums: Vec<&str> =
            step.file.iter().flat_map(|file| file.enum_type.iter().map(|it| it.name())).collect();
        assert_eq!(enums, ["Medium", "FrameOutcome"]);
    }
}
