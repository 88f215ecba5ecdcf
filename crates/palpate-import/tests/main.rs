//! Sources of every format, written from one small truth, imported and compared with it.

mod import;
