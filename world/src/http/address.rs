//! How many connections of a server come from one address.

use std::collections::HashMap;
use std::net::{IpAddr, Ipv6Addr};
use std::sync::{Arc, Mutex};

use crate::socket::lock;

/// The connections of a server, by the addresses that they come from.
pub(super) struct AddressCounts {
    most: usize,
    counts: Mutex<HashMap<IpAddr, usize>>,
}

/// A connection that counts as one of its address until this is dropped.
pub(super) struct CountedConnection {
    all: Arc<AddressCounts>,
    address: IpAddr,
}

impl AddressCounts {
    /// Returns counts of which none is above `most`.
    pub(super) fn new(most: usize) -> Arc<AddressCounts> {
        Arc::new(AddressCounts { most, counts: Mutex::default() })
    }

    /// Counts a connection from an address; `None` if there are as many as may be.
    pub(super) fn enter(self: &Arc<AddressCounts>, address: IpAddr) -> Option<CountedConnection> {
        let address = origin(address);
        let mut counts = lock(&self.counts);
        let count = counts.entry(address).or_default();
        if *count == self.most {
            return None;
        }
        *count += 1;
        Some(CountedConnection { all: self.clone(), address })
    }
}

impl Drop for CountedConnection {
    fn drop(&mut self) {
        let mut counts = lock(&self.all.counts);
        if let Some(count) = counts.get_mut(&self.address) {
            *count -= 1;
            if *count == 0 {
                counts.remove(&self.address);
            }
        }
    }
}

/// Returns the address that stands for all of one peer: a host has the last 64 bits of its IPv6 addresses to
/// itself.
fn origin(address: IpAddr) -> IpAddr {
    match address.to_canonical() {
        IpAddr::V6(address) => IpAddr::V6(Ipv6Addr::from_bits(address.to_bits() >> 64 << 64)),
        address @ IpAddr::V4(_) => address,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_has_a_limit_of_its_own() {
        let counts = AddressCounts::new(2);
        let enter = |address: &str| counts.enter(address.parse().expect("it is an address"));
        let first = enter("127.0.0.1").expect("there is room");
        let second = enter("::ffff:127.0.0.1").expect("it is the same address");
        assert!(enter("127.0.0.1").is_none());
        let other = enter("127.0.0.2").expect("it is another address");
        drop(first);
        let third = enter("127.0.0.1").expect("there is room again");
        let net = [enter("2001:db8::1"), enter("2001:db8::2")];
        assert!(net.iter().all(Option::is_some) && enter("2001:db8::ffff:0:1").is_none());
        assert!(enter("2001:db8:0:1::1").is_some());
        drop((second, third, other, net));
        assert!(lock(&counts.counts).is_empty());
    }
}
