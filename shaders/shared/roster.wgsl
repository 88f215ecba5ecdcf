//! Sections of the roster and of the sizes of dispatches, and what the items of a dispatch are. There is a section for each stage of
//! a member's solve; that of IDLE lists all that are well.

const SECTIONS = 4u;

// Kinds of items: the member itself, nodes, cells, blocks, patches, clamp cells, slices of groups of nodes,
// elastic points, groups of nodes, and workgroups that stay for a whole solve. The host's `Per` has the same numbers.
const PER_MEMBER = 0u;
const PER_NODE = 1u;
const PER_CELL = 2u;
const PER_BLOCK = 3u;
const PER_PATCH = 4u;
const PER_HOLD = 5u;
const PER_SLICE = 6u;
const PER_ELASTIC = 7u;
const PER_GROUP = 8u;
const PER_CREW = 9u;
const KINDS = 10u;

// Most nodes of a slice, each with eight lanes.
const NARROW = 32u;

// Most workgroups along one axis of a dispatch (the WebGPU limit; every device has at least this).
const WIDEST = 65535u;
