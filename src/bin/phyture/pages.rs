//! Where a page goes, and its figures as files: looked at before the work, written after it.

use crate::context::Context;
use crate::folder::NewFolder;
use phyture::Result;
use phyture::disk::{Target, write_atomically};
use phyture::report::{Page, page};
use std::path::{Path, PathBuf};

/// What is written for people to look at.
#[derive(clap::Args)]
pub struct Pages {
    /// Folder for the page, one HTML file that loads nothing
    #[arg(long, value_name = "DIR")]
    pub report: Option<PathBuf>,
    /// Where its figures go.
    #[command(flatten)]
    pub figures: Figures,
}

/// The figures of a page as files.
#[derive(clap::Args)]
pub struct Figures {
    /// Folder for each figure of the page as SVG, and what is drawn in it as CSV; new or empty
    #[arg(long, value_name = "DIR")]
    pub figures: Option<PathBuf>,
}

/// A page and figures that are going to be written.
pub struct Outlet {
    page: Option<Target>,
    figures: Option<(PathBuf, NewFolder)>,
}

impl Pages {
    /// Looks whether the page, of this name, and its figures can be written; `None` where neither is wanted.
    pub fn open(&self, context: &Context, name: &str) -> Result<Option<Outlet>> {
        let page = self.report.as_deref().map(|folder| context.new_page(folder, name)).transpose()?;
        let outlet = Outlet { page, figures: self.figures.open(context)? };
        Ok((outlet.page.is_some() || outlet.figures.is_some()).then_some(outlet))
    }
}

impl Figures {
    fn open(&self, context: &Context) -> Result<Option<(PathBuf, NewFolder)>> {
        let open = |folder: &PathBuf| Ok((folder.clone(), context.new_folder(folder)?));
        self.figures.as_ref().map(open).transpose()
    }

    /// The same for a page that is written in any case.
    pub fn beside(&self, context: &Context, page: Target) -> Result<Outlet> {
        Ok(Outlet { page: Some(page), figures: self.open(context)? })
    }
}

impl Outlet {
    /// Writes what was asked for and says where it is.
    pub fn write(self, context: &Context, content: &Page) -> Result<()> {
        if let Some(target) = &self.page {
            write_page(content, target)?;
            context.say(format!("report: {}", target.path().display()));
        }
        if let Some((folder, filled)) = self.figures {
            let count = write_figures(content, &folder)?;
            filled.close()?;
            context.say(format!("figures: {}, {count} as SVG and CSV", folder.display()));
        }
        Ok(())
    }
}

/// Writes a page.
pub fn write_page(content: &Page, target: &Target) -> Result<()> {
    let html = page(content);
    write_atomically(target.path(), |file| file.write_all(html.as_bytes()))
}

/// Writes every figure twice, and says how many there are.
fn write_figures(content: &Page, folder: &Path) -> Result<usize> {
    let figures = content.figures();
    for (name, figure) in &figures {
        for (ending, text) in [("svg", figure.svg()), ("csv", figure.csv())] {
            write_atomically(folder.join(format!("{name}.{ending}")), |file| file.write_all(text.as_bytes()))?;
        }
    }
    Ok(figures.len())
}
