# So that `snakemake --cores 2` works from here. The default target is not taken over by `include`.
include: "workflow/Snakefile"


localrules:
    paper,


rule paper:
    default_target: True
    input:
        rules.all.input,
