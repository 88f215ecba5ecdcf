//! Meetings of the workgroups that a system's solve is given for a whole dispatch: nobody goes on before all have come. Only where a probe has shown that so
//! many run at the same time (`probe_meeting`); should they not, whoever has waited in vain says so and all leave.
// use shared/structs

// Of each system: how often somebody has come to a meeting, how many have left for good, and 1 once somebody has waited in vain.
var<storage, read_write> meetings: array<atomic<u32>>;
var<workgroup> have_met: u32;

// How often to look for the others: software adapters leave every loop after 65,535 (costs/mod.rs).
const LOOKS = 60000u;

// Waits until `all` times somebody has come; false where that was in vain. What was written before is seen by all after.
fn meet(local: u32, system: u32, all: u32) -> bool {
    storageBarrier();
    workgroupBarrier();
    if local == 0u {
        atomicAdd(&meetings[3u * system], 1u);
        var met = 0u;
        for (var look = 0u; look < LOOKS; look++) {
            if atomicLoad(&meetings[3u * system]) >= all {
                met = 1u;
                break;
            }
            if atomicLoad(&meetings[3u * system + 2u]) != 0u {
                break;
            }
        }
        if met == 0u {
            atomicStore(&meetings[3u * system + 2u], 1u);
        }
        have_met = met;
    }
    let met = workgroupUniformLoad(&have_met) != 0u;
    storageBarrier();
    return met;
}

// The last of `crew` workgroups that leaves makes room for the next dispatch; whether it was this one, and whether somebody has waited in vain.
fn leave(system: u32, crew: u32) -> vec2<bool> {
    let last = atomicAdd(&meetings[3u * system + 1u], 1u) + 1u == crew;
    let in_vain = atomicLoad(&meetings[3u * system + 2u]) != 0u;
    if last {
        for (var k = 0u; k < 3u; k++) {
            atomicStore(&meetings[3u * system + k], 0u);
        }
    }
    return vec2(last, in_vain);
}
