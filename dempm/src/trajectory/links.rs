//! Groups and datasets by their path: there, absent or unreadable, and always in the file itself.
//!
//! HDF5 would follow a link into another file, or read the numbers of a dataset from one: a trajectory
//! from somebody else could make an export copy files of this machine.

use hdf5::dataset::Layout;
use hdf5::{Dataset, Group, IndexType, IterationOrder, LinkType, Result};

/// Whether there is something at `path` below `root`.
///
/// Unlike [`Group::link_exists`], a group that cannot be read is an error and not an empty one.
pub(super) fn exists(root: &Group, path: &str) -> Result<bool> {
    let (name, rest) = match path.split_once('/') {
        Some((name, rest)) => (name, Some(rest)),
        None => (path, None),
    };
    let link = root.find_link(IndexType::Name, IterationOrder::Native, |other, link| {
        Ok((other == name).then_some(link.link_type))
    })?;
    match (link, rest) {
        (None, _) => Ok(false),
        (Some(LinkType::Hard), None) => Ok(true),
        (Some(LinkType::Hard), Some(rest)) => exists(&root.group(name)?, rest),
        (Some(LinkType::Soft | LinkType::External), _) => {
            Err(format!("`{name}` is a link to another place, which is not followed").into())
        }
    }
}

/// Creates a group without time stamps.
pub(crate) fn new_group(parent: &Group, name: &str) -> Result<Group> {
    parent.create_group_builder().obj_track_times(false).create(name)
}

/// Opens the group at `path` below `root`.
pub(super) fn group(root: &Group, path: &str) -> Result<Group> {
    require(root, path)?;
    root.group(path)
}

/// Opens the dataset at `path` below `root`, whose numbers must be in the file.
pub(super) fn dataset(root: &Group, path: &str) -> Result<Dataset> {
    require(root, path)?;
    let dataset = root.dataset(path)?;
    let storage = dataset.dcpl()?;
    if storage.get_layout()? == Layout::Virtual || !storage.get_external()?.is_empty() {
        return Err("its numbers are in another dataset or file, which is not followed".into());
    }
    Ok(dataset)
}

fn require(root: &Group, path: &str) -> Result<()> {
    if exists(root, path)? { Ok(()) } else { Err("it is missing".into()) }
}
