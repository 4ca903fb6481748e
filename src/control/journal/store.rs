//! Where a journal lies.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

/// Bytes that survive: whatever [`Store::append`] has taken is there after a crash.
pub trait Store: Send {
    /// Begins anew.
    ///
    /// # Errors
    /// The system's.
    fn create(&mut self) -> io::Result<()>;

    /// Goes on behind the first `length` bytes; what follows them is cut off.
    ///
    /// # Errors
    /// The system's.
    fn keep(&mut self, length: usize) -> io::Result<()>;

    /// Adds bytes, and comes back once they are safe.
    ///
    /// # Errors
    /// The system's: a full disk, a stick that was pulled.
    fn append(&mut self, bytes: &[u8]) -> io::Result<()>;
}

/// A file.
#[derive(Debug)]
pub struct FileStore {
    path: PathBuf,
    file: Option<File>,
}

impl FileStore {
    /// The file at this path; nothing is touched yet.
    pub fn new(path: &Path) -> Self {
        Self {
            path: path.to_owned(),
            file: None,
        }
    }

    /// Where an earlier journal is put aside: the path with `.old` behind it.
    pub fn aside(path: &Path) -> PathBuf {
        let mut name = path.as_os_str().to_owned();
        name.push(".old");
        PathBuf::from(name)
    }
}

impl Store for FileStore {
    /// What is there is put aside first: it may be all that is known of a half-cut sheet.
    fn create(&mut self) -> io::Result<()> {
        match fs::rename(&self.path, Self::aside(&self.path)) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
            _ => {}
        }
        let file = OpenOptions::new()
            .append(true)
            .create_new(true)
            .open(&self.path)?;
        // The name must survive too.
        #[cfg(unix)]
        {
            let folder = self.path.parent().filter(|p| !p.as_os_str().is_empty());
            File::open(folder.unwrap_or(Path::new(".")))?.sync_all()?;
        }
        self.file = Some(file);
        Ok(())
    }

    fn keep(&mut self, length: usize) -> io::Result<()> {
        let file = OpenOptions::new().append(true).open(&self.path)?;
        file.set_len(length as u64)?;
        file.sync_all()?;
        self.file = Some(file);
        Ok(())
    }

    fn append(&mut self, bytes: &[u8]) -> io::Result<()> {
        let file = self
            .file
            .as_mut()
            .ok_or_else(|| io::Error::other("the journal was not begun"))?;
        file.write_all(bytes)?;
        file.sync_data()
    }
}

/// Memory, shared with whoever made it: for tests, and for a rehearsal of what a crash leaves.
#[derive(Clone, Debug, Default)]
pub struct MemoryStore {
    bytes: Arc<Mutex<Vec<u8>>>,
    /// So many bytes fit, as on a disk that fills up.
    room: Option<usize>,
}

impl MemoryStore {
    /// Holding these bytes.
    pub fn holding(bytes: &[u8]) -> Self {
        let store = Self::default();
        *store.lock() = bytes.to_vec();
        store
    }

    /// With room for so many bytes.
    pub fn with_room(room: usize) -> Self {
        Self {
            room: Some(room),
            ..Self::default()
        }
    }

    /// What it holds.
    pub fn bytes(&self) -> Vec<u8> {
        self.lock().clone()
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, Vec<u8>> {
        self.bytes.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Store for MemoryStore {
    fn create(&mut self) -> io::Result<()> {
        self.lock().clear();
        Ok(())
    }

    fn keep(&mut self, length: usize) -> io::Result<()> {
        self.lock().truncate(length);
        Ok(())
    }

    fn append(&mut self, bytes: &[u8]) -> io::Result<()> {
        let mut held = self.lock();
        let room = self
            .room
            .map_or(usize::MAX, |room| room.saturating_sub(held.len()));
        held.extend_from_slice(&bytes[..bytes.len().min(room)]);
        if room < bytes.len() {
            return Err(io::ErrorKind::StorageFull.into());
        }
        Ok(())
    }
}
