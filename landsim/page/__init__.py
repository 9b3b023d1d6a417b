"""The page that one hands in: a summary as one self-contained HTML file, and the same as Markdown.

::

    document     sections, paragraphs, tables, figures: what a page holds, and nothing of how it looks
    batch        the document of a batch, from its summary
    landing      its sections on how often the flights landed, where and how well
    navigation   its sections on errors by range, the filter and what matters
    comparison   that of batches side by side
    sentences    words that several parts share
    figure       a panel of a chart as Plotly takes it
    traces       its series
    legend       what the legend beside a chart shows
    render       a document as HTML, with the scripts and styles that it needs inside
    markdown     a document as Markdown, whose figures are the pictures beside it
"""
