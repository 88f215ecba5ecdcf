//! Sections of the roster and of the sizes of dispatches, and what the items of a dispatch are. There is a section for each stage of
//! a member's solve; that of IDLE lists all that are well.

const SECTIONS = 4u;

// Kinds of items: the member itself, nodes, cells, blocks, patches, clamp cells, nodes in wide workgroups, nodes with eight lanes
// each, elastic points, and groups of nodes. The host's `Per` has the same numbers.
const PER_MEMBER = 0u;
const PER_NODE = 1u;
const PER_CELL = 2u;
const PER_BLOCK = 3u;
const PER_PATCH = 4u;
const PER_HOLD = 5u;
const PER_WIDE = 6u;
const PER_ROW = 7u;
const PER_ELASTIC = 8u;
const PER_GROUP = 9u;
const KINDS = 10u;

// Nodes of a workgroup of PER_WIDE and PER_ROW.
const WIDE = 256u;
const NARROW = 32u;

// Most workgroups along one axis of a dispatch (the WebGPU limit; every device has at least this).
const WIDEST = 65535u;
