//! What both ends of the shared memory must build in the same way: iceoryx2's configuration and the kinds of services.
//!
//! The configuration is made in code: iceoryx2 would otherwise look for a file, in the current folder first.

use crate::Error;
use contactd_proto::control::ControlHeader;
use contactd_proto::names::Address;
use contactd_proto::{ContactRecord, PoseRecord, StepReply, StepRequest};
use iceoryx2::node::NodeCreationFailure;
use iceoryx2::port::client::Client;
use iceoryx2::port::server::Server;
use iceoryx2::prelude::*;
use iceoryx2::service::port_factory::request_response::PortFactory as RequestResponse;
use std::time::Duration;

/// The variant of iceoryx2's services that is used.
pub type Variant = ipc::Service;
/// The server's: the same in shared memory, its ports may go from one thread to another.
pub type Shared = ipc_threadsafe::Service;
/// The step service.
pub type StepService = RequestResponse<Variant, [PoseRecord], StepRequest, [ContactRecord], StepReply>;
/// A client's port of it.
pub type StepClient = Client<Variant, [PoseRecord], StepRequest, [ContactRecord], StepReply>;
/// The server's port of it.
pub type StepServer = Server<Shared, [PoseRecord], StepRequest, [ContactRecord], StepReply>;
/// The control service.
pub type ControlService = RequestResponse<Variant, [u8], ControlHeader, [u8], ControlHeader>;
/// A client's port of it.
pub type ControlClient = Client<Variant, [u8], ControlHeader, [u8], ControlHeader>;
/// The server's port of it.
pub type ControlServer = Server<Shared, [u8], ControlHeader, [u8], ControlHeader>;
/// Key of the one entry of the status service.
pub const STATUS_KEY: u32 = 0;

/// iceoryx2's configuration of one incarnation of a server.
///
/// # Errors
/// `System` when a path is too long for iceoryx2.
pub fn config(address: &Address, epoch: u64) -> Result<Config, Error> {
    let mut config = Config::default();
    let root = address.shared_folder();
    let root = Path::new(root.as_os_str().as_encoded_bytes());
    config.global.set_root_path(&root.map_err(|_| Error::System("the runtime folder's path is too long".into()))?);
    let prefix = FileName::new(address.prefix_of(epoch).as_bytes());
    config.global.prefix = prefix.map_err(|_| Error::System("the server's name is too long".into()))?;
    // Sockets' paths are short.
    config.global.service.event_connection_suffix = FileName::new(b".e").map_err(|e| system("a suffix", e))?;
    // The server looks for dead nodes, when a process has died; a client that comes or goes has no time for it.
    config.global.node.cleanup_dead_nodes_on_creation = false;
    config.global.node.cleanup_dead_nodes_on_destruction = false;
    config.global.service.cleanup_dead_nodes_on_open = false;
    Ok(config)
}

/// A node of this process in an incarnation.
///
/// # Errors
/// `System`.
pub fn node(config: &Config) -> Result<Node<Variant>, Error> {
    node_of(config)
}

/// The same for either variant.
///
/// # Errors
/// `System`.
pub fn node_of<V: iceoryx2::service::Service>(config: &Config) -> Result<Node<V>, Error> {
    // Its log would go to the user's terminal, for conditions that are handled here.
    set_log_level(LogLevel::Fatal);
    // Signals belong to the program; iceoryx2 would install handlers of its own.
    let create = || {
        let builder = NodeBuilder::new().config(config).signal_handling_mode(SignalHandlingMode::Disabled);
        builder.create::<V>()
    };
    // On a machine under heavy load iceoryx2 sometimes fails with an internal error; another try has another id.
    for _ in 0..3 {
        match create() {
            Err(NodeCreationFailure::InternalError) => std::thread::sleep(Duration::from_millis(10)),
            made => return made.map_err(|e| system("a node cannot be created", e)),
        }
    }
    create().map_err(|e| system("a node cannot be created", e))
}

/// A service name from a text that is known to be one.
///
/// # Errors
/// `System`.
pub fn service_name(name: &str) -> Result<ServiceName, Error> {
    ServiceName::new(name).map_err(|e| system(name, e))
}

/// An error of the shared memory layer.
pub fn system(what: &str, e: impl std::fmt::Debug) -> Error {
    Error::System(format!("shared memory: {what}: {e:?}"))
}
