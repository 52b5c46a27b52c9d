"""The live page: a browser draws a recording while it grows. The drawn samples are thinned out, the file is not."""
