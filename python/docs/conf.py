"""Pages of fmurun: `sphinx-build -W -b html python/docs OUT`, without network, where fmurun is installed."""

from importlib import metadata

project = "fmurun"
try:
    release = metadata.version("fmurun")
except metadata.PackageNotFoundError:
    release = ""
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
myst_enable_extensions = ["colon_fence"]
myst_heading_anchors = 3
autodoc_member_order = "bysource"
autodoc_typehints = "none"
# The pages do not need the engines.
autodoc_mock_imports = ["dask", "distributed", "fsspec", "gymnasium", "pyarrow"]
napoleon_use_rtype = False
exclude_patterns = ["build"]
html_theme = "alabaster"
html_theme_options = {"description": "Runs FMUs of FMI 2.0 and FMI 3.0", "page_width": "1280px", "body_max_width": "none", "fixed_sidebar": True}
html_sidebars = {"**": ["about.html", "searchfield.html", "navigation.html"]}
html_static_path = ["_static"]
html_copy_source = False
html_show_sphinx = False
html_show_copyright = False
