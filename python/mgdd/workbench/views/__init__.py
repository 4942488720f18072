"""The pages of the workbench, each a thin layer over the public interface."""
